"""Robots with several arms: whose each joint group and action number is."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from robot_layouts.kinematics.rotations import transform
from robots import ActionSplit, DescriptorError, JointGroup, Limb, RobotDescriptor, RobotRegistry
from robots.guessing.anatomy import find_anatomy
from robots.guessing.tool import Tool, find_base, find_reach
from robots.registry import CATALOGUE
from robots.urdf.reading import read_model
from robots.urdf.summary import read_cleaned
from tests.catalogue import every_robot

TWO_ARMED = [name for name in CATALOGUE if RobotRegistry.load(name).limbs]
DUAL = RobotRegistry.load("mobile_panda_dual")
PANDA = RobotRegistry.load("panda")


def test_limbs_share_out_the_action_in_its_order():
    parts = DUAL.parts
    assert list(parts) == ["left", "right", "body"]
    assert [part.action_dim for part in parts.values()] == [8, 8, 1]
    assert sum(part.action_dim for part in parts.values()) == DUAL.action_dim
    names = [f"{n.group}.{n.joints}" for p in parts.values() for n in p.describe_action()]
    assert names == [f"{n.group}.{n.joints}" for n in DUAL.describe_action()]


def test_a_limb_is_described_like_a_robot():
    right = DUAL.parts["right"]
    assert right.tcp_link == "right_panda_hand_tcp"
    assert right.fingers is not None
    assert right.fingers.links == ("right_panda_leftfinger", "right_panda_rightfinger")
    assert right.arm_joints == tuple(f"right_panda_joint{i}" for i in range(1, 8))
    assert right.keyframe("rest") == PANDA.keyframe("rest")
    assert not right.parts


def test_a_robot_without_limbs_has_no_parts():
    assert PANDA.limbs == PANDA.parts == {}


def test_limbs_are_frozen_compared_and_pickled_with_their_robot():
    with pytest.raises(TypeError, match="a descriptor is frozen"):
        DUAL.limbs["third"] = DUAL.limbs["left"]  # type: ignore[index]
    assert pickle.loads(pickle.dumps(DUAL)) == DUAL
    assert replace(DUAL, limbs={}) != DUAL
    assert hash(DUAL) == hash(replace(DUAL))


def test_their_groups_may_be_named():
    groups = {"one": ("left_arm", "left_gripper"), "two": ("right_arm", "right_gripper")}
    limbs = {name: Limb("left_panda_hand_tcp", 0.9, groups=own) for name, own in groups.items()}
    assert list(replace(DUAL, limbs=limbs).parts) == ["one", "two", "body"]


@pytest.mark.parametrize(
    ("limbs", "message"),
    [
        ({"third": Limb("a", 1.0)}, "limb 'third' takes no action number; .* groups are left_arm"),
        (
            {"left": Limb("a", 1.0, groups=("lef_arm",))},
            "a joint group 'lef_arm', which does not exist",
        ),
        ({"body": Limb("a", 1.0)}, "'body' names no limb"),
        ({"left.arm": Limb("a", 1.0)}, "'left.arm' names no limb"),
        (
            {"left": Limb("a", 1.0), "arm": Limb("a", 1.0)},
            "'left_arm' belongs to two limbs, 'left' and 'arm'",
        ),
        (
            {"left": Limb("a", 1.0, groups=("left_arm", "right_arm"))},
            "groups of 'left' do not follow one another: left_arm, left_gripper, right_arm",
        ),
        ({"left": "left_arm"}, "limbs.*'left_arm'"),
    ],
)
def test_limbs_that_make_no_sense_are_refused(limbs, message):
    with pytest.raises(DescriptorError, match=message):
        replace(DUAL, limbs=limbs)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"reach": 0.0}, "reach is 0.0 m; it must be positive"),
        ({"reach": float("nan")}, "reach"),
        ({"reach": 1.0, "tcp_position_links": ("a", "a")}, "tcp_position_links has a more than"),
        ({"reach": 1.0, "base": (0.0, 1.0)}, "base"),
    ],
)
def test_a_limb_refuses_what_it_cannot_have(fields, message):
    with pytest.raises(DescriptorError, match=f"Limb: {message}"):
        Limb("tcp", **fields)


def test_what_is_driven_besides_limbs_must_be_in_one_piece():
    arm = JointGroup(("a",), -1.0, 1.0, 1.0, 1.0, 1.0)
    split = ActionSplit(
        torso=replace(arm, joints=("t",)), left_arm=arm, head=replace(arm, joints=("h",))
    )
    with pytest.raises(DescriptorError, match="groups of 'body' do not follow one another"):
        RobotDescriptor(
            "odd",
            PANDA.urdf,
            split,
            "tcp",
            {"rest": (0.0,) * 3},
            "made up",
            1.0,
            limbs={"left": Limb("tcp", 1.0)},
        )


@pytest.mark.parametrize("name", every_robot(TWO_ARMED))
def test_bases_and_reaches_of_the_catalogue_are_those_of_the_urdf(name):
    robot = RobotRegistry.load(name)
    path = robot.urdf.locate()
    model = read_model(read_cleaned(path).xml, path.as_posix())
    rest = dict(zip(robot.joints, robot.keyframe(robot.home.keyframe), strict=True))
    found = {limb.name: limb for limb in find_anatomy(model, path.as_posix()).limbs}
    assert set(found) == set(robot.limbs)
    for side, limb in robot.limbs.items():
        assert {limb.tcp_link, *limb.tcp_position_links} <= set(model.links)
        assert limb.fingers is None or set(limb.fingers.links) <= set(model.links)
        np.testing.assert_allclose(limb.base, find_base(model, found[side], rest), atol=1e-4)
        tool = Tool(limb.tcp_link, limb.tcp_position_links, "", limb.tcp_offset)
        reach, _ = find_reach(model, found[side], tool, rest, limb.base)
        assert limb.reach == pytest.approx(reach, abs=1e-3)


def test_arms_of_the_catalogue_are_mirror_images():
    for name in TWO_ARMED:
        left, right = RobotRegistry.load(name).limbs.values()
        assert right.base == tuple(transform(np.diag([1.0, -1.0, 1.0, 1.0]), np.array(left.base)))
        assert left.reach == right.reach
