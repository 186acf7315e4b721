"""Robots that were only guessed reach what their actions ask for, light ones and heavy ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from layouts import single
from robot_layouts.simulation import Box, PhysicsSettings, Simulation
from robot_layouts.simulation.checks.trial import try_robot
from robots import RobotDescriptor
from robots.from_urdf import guess_descriptor
from tests.robots.test_guessing import knuckles, single_arm
from tests.robots.urdf_parts import Parts


class Standing:
    """A guessed robot that stands in a world of its own."""

    def __init__(self, parts: Parts, folder: Path) -> None:
        self.robot: RobotDescriptor = guess_descriptor(parts.write(folder), "made").descriptor
        layout = single({"arm": self.robot})
        self.simulation = Simulation(layout, lambda world, _: None, 1, PhysicsSettings())
        self.start = np.array(self.robot.keyframe("rest"))

    def again(self) -> None:
        self.simulation.worlds[0].stand("arm", self.start)
        self.simulation.touched()

    def play(self, action: np.ndarray, steps: int = 1) -> np.ndarray:
        """Return the joint positions after some steps (rad, m)."""
        for _ in range(steps):
            positions = self.simulation.read().joint_positions
            self.simulation.step(action[None], positions)
        return np.array(self.simulation.read().joint_positions[0])


def weighing(mass: float, effort: float) -> Parts:
    """Return an arm whose links all have one mass (kg), with one effort for all joints (N·m)."""
    parts, _ = single_arm()
    parts.links = [
        link.replace('mass value="0.5"', f'mass value="{mass}"').replace(
            '"0.0005"', f'"{mass * 1e-3}"'
        )
        for link in parts.links
    ]
    parts.joints = [joint.replace('effort="100.0"', f'effort="{effort}"') for joint in parts.joints]
    return parts


@pytest.mark.parametrize(("mass", "effort"), [(0.02, 1.0), (0.5, 100.0), (20.0, 300.0), (5.0, 0)])
def test_one_control_step_covers_what_an_action_number_asks_for(tmp_path, mass, effort):
    standing = Standing(weighing(mass, effort), tmp_path)
    numbers = standing.robot.describe_action()
    assert len(numbers) == 6
    for number in numbers:
        standing.again()
        action = np.zeros(6, np.float32)
        action[number.index] = 1.0
        moved = standing.play(action) - standing.start
        assert 0.04 <= number.upper <= 0.1
        assert 0.9 <= moved[number.index] / number.upper <= 1.2, number.name
        assert np.abs(np.delete(moved, number.index)).max() < 0.1 * number.upper, number.name


def test_a_stretched_arm_moves_one_joint_alone_as_physics_has_its_motors(tmp_path):
    robot = guess_descriptor(weighing(0.5, 100.0).write(tmp_path), "made").descriptor
    robot = replace(robot, keyframes={"rest": (0.0,) * 6})
    group = robot.action_split.groups["arm"]
    assert min(group.armatures) > 0
    bare = robot.action_split.replace(arm=replace(group, armature=0.0))
    with_motors, without = (
        max(number.other.amount for number in try_robot(one, steps=1).numbers if number.other)
        for one in (robot, replace(robot, action_split=bare))
    )
    assert with_motors < 0.1 < without


def test_efforts_that_move_nothing_are_raised_and_the_reason_says_so(tmp_path):
    found = guess_descriptor(weighing(20.0, 1.0).write(tmp_path), "made")
    forces = [drive[2] for drive in found.descriptor.action_split.groups["arm"].drives]
    assert max(forces) > 100.0
    assert any("more than the URDF's efforts for a_joint1" in reason for reason in found.reasons)


def test_every_joint_of_a_mimic_tree_goes_where_its_leader_sends_it(tmp_path):
    parts, last = single_arm(end="")
    knuckles(parts, last)
    standing = Standing(parts, tmp_path)
    standing.again()
    group = standing.robot.action_split.groups["gripper"]
    action = np.zeros(standing.robot.action_dim, np.float32)
    for number, steps in ((-0.5, 20), (1.0, 20)):
        action[-1] = number
        after = dict(zip(standing.robot.joints, standing.play(action, steps), strict=True))
        (low, high) = group.ranges[0]
        lead = (low + high) / 2 + number * (high - low) / 2
        for joint, (multiplier, offset) in zip(group.joints, group.followers, strict=True):
            assert after[joint] == pytest.approx(multiplier * lead + offset, abs=0.02), joint
        speeds = np.abs(np.array(standing.simulation.read().joint_velocities))
        assert speeds.max() < 1.0


@pytest.mark.parametrize(("linked", "watched"), [(True, False), (True, True), (False, False)])
def test_jaws_that_hold_something_stay_parallel_if_their_joints_are_a_linkage(
    tmp_path, linked, watched
):
    parts, last = single_arm(end="")
    knuckles(parts, last)
    robot = guess_descriptor(parts.write(tmp_path), "made").descriptor
    group = robot.action_split.groups["gripper"]
    if not linked:
        loose = robot.action_split.replace(gripper=replace(group, leaders=(), lead=0.0))
        robot = replace(robot, action_split=loose)
    layout = single({"arm": robot})
    alone = Simulation(layout, lambda world, _: None, 1, PhysicsSettings())
    alone.worlds[0].stand("arm", robot.keyframe("rest"))
    centre = alone.read().tcp_position("arm")[0]
    turned = alone.read().link_pose("arm", robot.tcp_link)[0, 3:]
    block = Box(half_size=(0.03, 0.025, 0.03))

    def build(world, _):
        world.add("block", block, kind="static", position=centre, quaternion=turned)

    simulation = Simulation(layout, build, 1, PhysicsSettings())
    if watched:  # what looks at each step of physics leaves them as they are
        simulation.backend.watch_arms()
    simulation.worlds[0].stand("arm", robot.keyframe("rest"))
    action = np.zeros((1, robot.action_dim), np.float32)
    action[0, -1] = -1.0
    for _ in range(30):
        simulation.step(action, simulation.read().joint_positions)
    state = simulation.read()
    at = dict(zip(robot.joints, state.qpos("arm")[0], strict=True))
    sides = (("drive", "left_pad_joint"), ("right_outer_joint", "right_pad_joint"))
    splayed = max(abs(at[pad] - at[knuckle]) for knuckle, pad in sides)
    assert (splayed < 0.05) == linked
    assert not linked or 0.2 < at["drive"] < 0.5  # the block stops it
    assert not linked or np.abs(state.joint_velocities).max() < 0.2
