"""Which action numbers drive a joint group somewhere, whatever its control mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Floats, inverse, multiply, rotate, rotation_of
from layouts import Layout
from robots import JointGroup
from simulation import State
from tasks.engine.task import MultiRobotTask

_NEARLY = 1.0 + 1e-4  # of a normalised number that is just at its bound


@dataclass(frozen=True)
class DrivenGroup:
    """A joint group of a layout, in its control mode.

    Attributes:
        robot: Name of its robot in the layout.
        name: Its own.
        arm: The robot or limb that it belongs to; None if that has no TCP.
        group: What is driven, and how.
        numbers: Where its numbers stand in an action.
        joints: Where its joints are among those of all robots.
    """

    robot: str
    name: str
    arm: str | None
    group: JointGroup
    numbers: slice
    joints: slice


def driven_groups(layout: Layout) -> Iterator[DrivenGroup]:
    """Yield the joint groups of a layout, also those that are held, in the order of the action."""
    arms = layout.arms_by_group
    number = joint = 0
    for robot, placement in layout.items():
        for name, group in placement.robot.action_split.groups.items():
            numbers = slice(number, number + group.size)
            joints = slice(joint, joint + len(group.joints))
            yield DrivenGroup(robot, name, arms.get((robot, name)), group, numbers, joints)
            number, joint = numbers.stop, joints.stop


class JointNumbers:
    """The numbers of a group that is driven by positions of its joints, or by their velocities."""

    def __init__(self, driven: DrivenGroup, task: MultiRobotTask) -> None:
        """Take the group of a task with one environment."""
        self._driven, self._task = driven, task
        asks = driven.group.asks
        self.by_speed = asks.velocities and not asks.positions

    def towards(self, wanted: Floats, state: State) -> tuple[Floats, bool]:
        """Return the numbers, and whether none had to be cut to be within bounds.

        Args:
            wanted: Positions that the joints are to be pulled to (rad, m), (n,); if the group is
                driven by velocities, these (rad/s, m/s).
            state: The world before the step.
        """
        group = self._driven.group
        if self.by_speed:
            return normalised(group, wanted)
        if group.delta:
            kept = group.target and remembered(self._task, self._driven, "target_qpos")
            wanted = wanted - (kept if group.target else self.where(state))
        if group.mimic:
            multiplier, offset = group.followers[0]
            wanted = (wanted[:1] - (0.0 if group.delta else offset)) / multiplier
        if group.asks.velocities:  # a drive to positions brakes by itself
            wanted = np.concatenate([wanted, np.zeros(len(group.joints))])
        return normalised(group, wanted)

    def where(self, state: State) -> Floats:
        """Return the joints' positions, (n,) (rad, m)."""
        return state.joint_positions[0, self._driven.joints].astype(float)


class TcpNumbers:
    """The numbers of a group that is driven by where its TCP is to be, in the world."""

    def __init__(self, driven: DrivenGroup, task: MultiRobotTask) -> None:
        """Take the group of a task with one environment."""
        assert driven.arm is not None
        self._driven, self._task, self._arm = driven, task, driven.arm
        self._robot = task.layout.arm(driven.arm).robot
        self._forward = task.simulation.backend.point_reach(driven.arm).forward

    def towards(self, pose: Floats, state: State) -> tuple[Floats, bool]:
        """Return the numbers, and whether none had to be cut to be within bounds.

        Args:
            pose: Where the TCP is to be: position (m, world), then quaternion (wxyz), (7,).
            state: The world before the step.
        """
        group, root = self._driven.group, self._root(state)
        place, turn = _seen_from(root, pose)
        if not group.delta:
            return normalised(group, np.concatenate([place, _angles(turn)]))
        if group.target:
            before = remembered(self._task, self._driven, "target_pose")
            before, ways = before[:3], before[3:]
        else:
            before, ways = _seen_from(root, self.where(state))
        moves, turns = group.frame.split(":")
        way = place - before
        way = way if moves.startswith("root") else rotate(inverse(ways), way)
        if not group.asks.turn:
            return normalised(group, way)
        back = inverse(ways)
        rest = multiply(turn, back) if turns.startswith("root") else multiply(back, turn)
        return normalised(group, np.concatenate([way, _angles(rest)]))

    def where(self, state: State) -> Floats:
        """Return the TCP's pose: position (m, world), then quaternion (wxyz), (7,)."""
        return state.tcp_pose(self._arm)[0].astype(float)

    def pose(self, joints: Floats, state: State) -> Floats:
        """Return the TCP's pose at some joints, (7,).

        Args:
            joints: Positions of all robots' joints, (dof,) (rad, m).
            state: The world; where the TCP is none of the robot's links, it lies beside that link
                as it does there.
        """
        robot = self._robot
        places = self._task.simulation.index.joints[self._arm]
        own = dict(zip(robot.joints, joints[places], strict=True))
        place, turn = self._forward(np.array([own[joint] for joint in robot.arm_joints]))
        link = state.link_pose(self._driven.robot, robot.tcp_link)[0].astype(float)
        beside = self.where(state)[:3] - link[:3]
        return np.concatenate([place + rotate(turn, rotate(inverse(link[3:]), beside)), turn])

    def _root(self, state: State) -> Floats:
        robot, link = self._driven.robot, self._driven.group.root_link
        pose = state.base_pose(robot) if link is None else state.link_pose(robot, link)
        return pose[0].astype(float)


def remembered(task: MultiRobotTask, driven: DrivenGroup, kind: str) -> Floats:
    """Return what a group was last asked for; see `simulation.control.modes.Remembered`."""
    modes = task.simulation.modes
    assert modes is not None
    names = [(kept.robot, kept.group, kept.kind) for kept in modes.remembered]
    return modes.recall()[names.index((driven.robot, driven.name, kind))][0].astype(float)


def normalised(group: JointGroup, values: Floats) -> tuple[Floats, bool]:
    """Return what a group is to be asked for as its numbers, and whether none had to be cut."""
    if not group.normalised:
        return values, True
    low, high = np.array(group.ranges).T
    numbers = (values - (high + low) / 2) / ((high - low) / 2)
    if group.asks.turn:
        turn = values[3:] / low[-1]  # ManiSkill scales a turn by its lower bound
        length = float(np.linalg.norm(turn))
        numbers[3:] = turn / max(length, 1.0)
        return np.clip(numbers, -1, 1), length <= _NEARLY and bool((abs(numbers) <= _NEARLY).all())
    return np.clip(numbers, -1, 1), bool((abs(numbers) <= _NEARLY).all())


def further(wanted: Floats, passed: Floats, own: Floats, share: float) -> Floats:
    """Return poses further by a share of what some miss of others, (..., 7).

    Args:
        wanted: Poses to start from: position (m), quaternion (wxyz).
        passed: Where something should have been.
        own: Where it was.
        share: Of the way between the two.
    """
    places = wanted[..., :3] + share * (passed[..., :3] - own[..., :3])
    missed = multiply(passed[..., 3:], inverse(own[..., 3:]))
    missed = missed * np.where(missed[..., :1] < 0, -share, share)
    missed[..., 0] += 1 - share
    missed /= np.linalg.norm(missed, axis=-1, keepdims=True)
    return np.concatenate([places, multiply(missed, wanted[..., 3:])], -1)


def _seen_from(root: Floats, pose: Floats) -> tuple[Floats, Floats]:
    """Return place and turn of a pose of the world in the frame of another."""
    back = inverse(root[3:])
    return rotate(back, pose[:3] - root[:3]), multiply(back, pose[3:])


def _angles(quaternion: Floats) -> Floats:
    """Return the turns about x, then the turned y, then the turned z (rad), (3,)."""
    matrix = rotation_of(quaternion)
    return np.array(
        [
            np.arctan2(-matrix[1, 2], matrix[2, 2]),
            np.arcsin(np.clip(matrix[0, 2], -1, 1)),
            np.arctan2(-matrix[0, 1], matrix[0, 0]),
        ]
    )
