"""Every robot of the catalogue stands, and each of its action numbers moves its own joints."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import sapien

from layouts import single
from robot_layouts.simulation import PhysicsSettings, Simulation
from robot_layouts.simulation.control.joint_positions import JointPositionController
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import RobotRegistry
from robots.assets.manifest import find_package
from robots.from_urdf import guess_descriptor
from robots.registry import CATALOGUE
from tests.catalogue import every_robot

STEPS = 5


@functools.cache
def simulation_of(robot: str) -> Simulation:
    return Simulation(single({"arm": robot}), lambda world, _: None, 1, PhysicsSettings())


def stand(robot: str, keyframe: str | None = None) -> tuple[Simulation, np.ndarray]:
    """Stand the robot at a keyframe; return joint positions in the descriptor's order."""
    simulation = simulation_of(robot)
    placement = simulation.layout["arm"]
    start = np.array(placement.robot.keyframe(keyframe) if keyframe else placement.start_qpos)
    for world in simulation.worlds:
        world.stand("arm", start)
    simulation.touched()  # what is below the seam moves now
    return simulation, start


def qpos(simulation: Simulation) -> np.ndarray:
    """Joint positions in the descriptor's order."""
    return simulation.read().joint_positions[0]


def play(simulation: Simulation, action: np.ndarray, steps: int) -> np.ndarray:
    for _ in range(steps):
        simulation.step(action[None], simulation.read().joint_positions)
    return qpos(simulation)


def staying(robot: str, start: np.ndarray) -> np.ndarray:
    """Return the action that asks for nothing: 0, or the position itself where it is absolute."""
    descriptor = RobotRegistry.load(robot)
    action = np.zeros(descriptor.action_dim, np.float32)
    for number in descriptor.describe_action():
        if not number.relative:
            group = descriptor.action_split.groups[number.group]
            ratio, offset = group.followers[0]
            value = (start[descriptor.joints.index(number.joints[0])] - offset) / ratio
            middle = (number.upper + number.lower) / 2
            action[number.index] = (value - middle) / ((number.upper - number.lower) / 2)
    return action


def numbers() -> list[object]:
    """Every action number of every robot; those of a robot share its marks."""
    return [
        pytest.param(name, number, marks=given.marks, id=f"{name}-{number.name}")
        for name, given in zip(CATALOGUE, every_robot(), strict=True)
        for number in RobotRegistry.load(name).describe_action()
        if not number.unit.endswith("/s")  # no position that a joint is driven to
    ]


@pytest.mark.parametrize("robot", every_robot())
def test_it_stays_at_every_keyframe(robot):
    for keyframe in RobotRegistry.load(robot).keyframes:
        simulation, start = stand(robot, keyframe)
        after = play(simulation, staying(robot, start), 20)
        np.testing.assert_allclose(after, start, atol=0.02, err_msg=keyframe)


@pytest.mark.parametrize(("robot", "number"), numbers())
def test_an_action_number_moves_its_own_joints_and_no_others(robot, number):
    simulation, start = stand(robot)
    still = staying(robot, start)
    mine = [simulation.layout["arm"].robot.joints.index(joint) for joint in number.joints]
    low, high = simulation.index.robots["arm"].limits[mine].min(0)
    room_above = high - start[mine[0]] > start[mine[0]] - low
    if not number.relative:  # and may go the other way, where its joint has a negative ratio
        room_above = still[number.index] < 0
    action = still.copy()
    action[number.index] = 0.8 if room_above else -0.8

    controller = JointPositionController(simulation.layout)
    now = simulation.read().joint_positions
    change = controller.targets(action[None], now) - controller.targets(still[None], now)
    assert np.flatnonzero(change[0]).tolist() == mine

    moved = np.abs(play(simulation, action, STEPS) - start)
    own, others = moved[mine], np.delete(moved, mine)
    assert (own > 0.003).all()
    least = 0.2 if number.unit.startswith("m") and number.relative else 0.02  # a metre swings more
    assert others.max(initial=0.0) < 0.4 * max(own.max(), least)


@pytest.mark.parametrize("robot", ["panda", "koch", "xarm7"])
def test_no_pose_is_farther_than_the_reach_and_some_come_near(robot):
    found = guess_descriptor(RobotRegistry.load(robot).urdf.locate()).descriptor
    simulation, _ = stand(robot)
    arm = worlds_below(simulation)[0].robots["arm"]
    arm.articulation.set_root_pose(sapien.Pose())
    limits = np.concatenate([joint.limits for joint in arm.joints])
    rng = np.random.default_rng(0)
    farthest = 0.0
    for _ in range(3000):
        arm.articulation.set_qpos(rng.uniform(*limits.T))
        points = found.tcp_position_links or (found.tcp_link,)
        middle = np.mean([arm.links[link].entity_pose.p for link in points], axis=0)
        assert not any(found.tcp_offset)
        farthest = max(farthest, float(np.hypot(*middle[:2])))
    assert 0.9 * found.reach < farthest < found.reach + 1e-3


HANDS = ("dclaw/dclaw_gripper_glb.urdf", "allegro/allegro_hand_right.urdf")
# Of these, joints that a guess only holds give way by more than 0.01 rad or m.
LOOSE = ("floating_inspire_hand_left", "floating_inspire_hand_right", "tiago_pro")
FIRM = [name for name in CATALOGUE if name not in LOOSE]


@pytest.mark.long
@pytest.mark.parametrize("robot", [*every_robot(FIRM), *HANDS])
def test_a_robot_that_was_only_guessed_stands_and_moves(robot):
    if robot in HANDS:
        path = find_package("mani_skill") / "mani_skill" / "assets" / "robots" / robot
    else:
        path = RobotRegistry.load(robot).urdf.locate()
    guessed = guess_descriptor(path, "guessed").descriptor
    simulation = Simulation(single({"arm": guessed}), lambda world, _: None, 1, PhysicsSettings())
    simulation.worlds[0].stand("arm", guessed.keyframe("rest"))
    before = qpos(simulation)
    action = np.full(guessed.action_dim, 0.3, np.float32)
    after = play(simulation, action, STEPS)
    assert np.isfinite(after).all()
    held = [j for g in guessed.action_split.groups.values() if g.held for j in g.joints]
    moved = dict(zip(guessed.joints, np.abs(after - before), strict=True))
    assert all(moved[joint] < 0.01 for joint in held)
    assert max(moved.values()) > 0.02
