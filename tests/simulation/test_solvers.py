"""Solvers that read the robot's file say what SAPIEN's do."""

from __future__ import annotations

import numpy as np
import pytest

from layouts import Layout, Placement
from robot_layouts.simulation.sapien3.arms import PinocchioFollower, SapienArm
from robot_layouts.simulation.solvers import ArmModel, TreeArm, TreeFollower
from robots import DescriptorError, RobotRegistry, UnknownNameError
from tests.catalogue import QUICK
from tests.simulation.test_kinematics import start_of, world_of

POINT = np.array([0.01, -0.02, 0.03])
HOW_FAR = 0.05  # rad, m
HANDS = ("allegro_hand_right",)  # fingers of four joints that hardly tell some turns apart


def arms_of(robot: str) -> tuple[SapienArm, TreeArm]:
    world = world_of(robot)
    return SapienArm(world, "arm"), TreeArm(world.layout, "arm")


def moved(arm: ArmModel, qpos: np.ndarray) -> np.ndarray:
    """Return arm joints a little away from where they start."""
    ways = HOW_FAR * np.sin(np.arange(1, len(arm.joints) + 1))
    return np.clip(qpos[arm.places] + ways, arm.low, arm.high)


def expect_close(
    one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], atol: float = 1e-6
) -> None:
    """Expect two poses to be equal, as far as SAPIEN's of single precision can be."""
    np.testing.assert_allclose(one[0], other[0], atol=atol)
    turned = np.sign(np.dot(one[1], other[1])) * other[1]
    np.testing.assert_allclose(one[1], turned, atol=atol)


@pytest.mark.parametrize("robot", QUICK)
def test_arms_are_where_sapien_has_them(robot):
    sapien, tree = arms_of(robot)
    assert tree.joints == sapien.joints
    np.testing.assert_array_equal(tree.places, sapien.places)
    np.testing.assert_allclose((tree.low, tree.high), (sapien.low, sapien.high), rtol=1e-6)
    arm = moved(tree, start_of(robot))
    expect_close(tree.link_pose(arm), sapien.link_pose(arm))
    expect_close(tree.tcp_pose(arm), sapien.tcp_pose(arm))
    np.testing.assert_allclose(tree.place_of(POINT, arm), sapien.place_of(POINT, arm), atol=1e-6)


@pytest.mark.parametrize("robot", QUICK)
def test_descents_end_where_sapiens_do(robot):
    sapien, tree = arms_of(robot)
    start = start_of(robot)
    pose = tree.tcp_pose(moved(tree, start))
    ends = [arm.descend(*pose, start[None]) for arm in (sapien, tree)]
    assert len(ends[0]) == len(ends[1]) == 1
    expect_close(*(tree.tcp_pose(end[0]) for end in ends), atol=2e-5 if robot in HANDS else 2e-6)


@pytest.mark.parametrize("robot", QUICK)
def test_what_follows_a_pose_ends_where_pinocchio_does(robot):
    world, start = world_of(robot), start_of(robot)
    descriptor = world.layout["arm"].robot
    asked = descriptor.tcp_link, None, descriptor.arm_joints
    urdf = descriptor.urdf.locate().read_bytes()
    followers = (
        PinocchioFollower(world.robots["arm"], urdf, *asked),
        TreeFollower(descriptor, *asked),
    )
    tree = TreeArm(Layout({"arm": Placement(descriptor, (0, 0, 0), (1, 0, 0, 0))}), "arm")
    position, quaternion = tree.link_pose(moved(tree, start))
    ends = [follower.follow(position, quaternion, start) for follower in followers]
    expect_close(*(tree.link_pose(end) for end in ends), atol=2e-5 if robot in HANDS else 1e-6)


def test_a_follower_looks_from_the_link_that_it_is_given():
    world, start = world_of("fetch"), start_of("fetch")
    descriptor = world.layout["arm"].robot
    beyond = [joint for joint in descriptor.arm_joints if joint != "torso_lift_joint"]
    asked = descriptor.tcp_link, "torso_lift_link", beyond
    urdf = descriptor.urdf.locate().read_bytes()
    place, turned = np.array([0.5, -0.1, 0.2]), np.array([1.0, 0.0, 0.0, 0.0])
    ends = [
        follower.follow(place, turned, start)
        for follower in (
            PinocchioFollower(world.robots["arm"], urdf, *asked),
            TreeFollower(descriptor, *asked),
        )
    ]
    assert ends[0] is not None
    torso = {"torso_lift_joint": start[descriptor.joints.index("torso_lift_joint")]}
    arms = [torso | dict(zip(beyond, end, strict=True)) for end in ends]
    tree = arms_of("fetch")[1]
    rows = [[arm[joint] for joint in tree.joints] for arm in arms]
    expect_close(*(tree.link_pose(row) for row in rows), atol=5e-5)  # it turns far


def test_what_cannot_be_reached_has_no_answer():
    tree, start = arms_of("panda")[1], start_of("panda")
    assert tree.descend((9.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), start[None]) == []
    follower = TreeFollower(RobotRegistry.load("panda"), "panda_hand_tcp", None, tree.joints)
    assert follower.follow((9.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), start) is None
    assert follower.follow((np.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), start) is None


def test_a_follower_names_what_it_cannot_follow():
    panda = RobotRegistry.load("panda")
    with pytest.raises(UnknownNameError, match="Did you mean 'panda_hand'"):
        TreeFollower(panda, "panda_hnd", None, panda.arm_joints)
    with pytest.raises(UnknownNameError, match="link beyond panda_link7 'panda_link3'"):
        TreeFollower(panda, "panda_link3", "panda_link7", panda.arm_joints)
    with pytest.raises(DescriptorError, match="none of panda_joint7 moves panda_link3"):
        TreeFollower(panda, "panda_link3", None, ("panda_joint7",))
