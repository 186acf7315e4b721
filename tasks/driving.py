"""Drives of joint groups: the action numbers that bring one to a target, by kind of action."""

from __future__ import annotations

import numpy as np

from layouts import Layout
from robot_layouts.kinematics.rotations import Floats, inverse, multiply, rotate, xyz_angles
from robot_layouts.simulation import State
from robot_layouts.simulation.control.joint_positions import DrivenGroup, driven_groups
from robots import JointGroup
from tasks.engine.env import TaskEnv

_NEARLY = 1.0 + 1e-4  # of a normalised number that is just at its bound


def joint_slices(layout: Layout) -> dict[str, slice]:
    """Return where each robot's joints are among those of all."""
    return {driven.robot: driven.own for driven in driven_groups(layout)}


class PositionDrive:
    """A group whose numbers are positions of its joints, with or without velocities.

    Its targets are positions of these joints (rad, m), (n,).
    """

    def __init__(self, driven: DrivenGroup, task: TaskEnv) -> None:
        """Take the group of a task with one environment."""
        self.driven, self._task = driven, task

    def toward(self, target: Floats, state: State) -> tuple[Floats, bool]:
        """Return the action numbers that drive to a target, and whether none had to be clipped.

        Args:
            target: Where to.
            state: The world before the step.
        """
        group = self.driven.group
        if group.target:
            target = target - _remembered(self._task, self.driven, "target_qpos")
        elif group.delta:
            target = target - self.at(state)
        if group.mimic:
            multiplier, offset = group.followers[0]
            target = (target[:1] - (0.0 if group.delta else offset)) / multiplier
        if group.asks.velocities:  # a drive to positions brakes by itself
            target = np.concatenate([target, np.zeros(len(group.joints))])
        return _normalised(group, target)

    def at(self, state: State) -> Floats:
        """Return the target that the group has reached now."""
        return self.target(state.joint_positions[0].astype(float), state)

    def target(self, joints: Floats, state: State) -> Floats:
        """Return the target that is reached at some joints.

        Args:
            joints: Positions of all robots' joints, (dof,) (rad, m).
            state: The world.
        """
        return joints[self.driven.joints]

    @staticmethod
    def shifted(target: Floats, wanted: Floats, reached: Floats, share: float) -> Floats:
        """Return targets further by a share of the way from what was reached to what was wanted."""
        return target + share * (wanted - reached)


class VelocityDrive(PositionDrive):
    """A group whose numbers are velocities of its joints, which `toward` takes (rad/s, m/s)."""

    def toward(self, target: Floats, state: State) -> tuple[Floats, bool]:
        """See `PositionDrive`."""
        return _normalised(self.driven.group, target)


class TcpDrive:
    """A group whose numbers are positions or poses of its TCP.

    Its targets are poses of the TCP in the world: position (m), then quaternion (wxyz), (7,).
    """

    def __init__(self, driven: DrivenGroup, task: TaskEnv) -> None:
        """Take the group of a task with one environment."""
        assert driven.arm is not None
        self.driven, self._task = driven, task
        self._arm, self._robot = driven.arm, task.layout.arm(driven.arm).robot
        self._forward = task.simulation.backend.point_reach(driven.arm).forward

    def toward(self, target: Floats, state: State) -> tuple[Floats, bool]:
        """See `PositionDrive`."""
        group = self.driven.group
        root = self._root(state)
        place, turn = _seen_from(root, target)
        if not group.delta:
            return _normalised(group, np.concatenate([place, xyz_angles(turn)]))
        if group.target:
            before = _remembered(self._task, self.driven, "target_pose")
            origin, turned = before[:3], before[3:]
        else:
            origin, turned = _seen_from(root, self.at(state))
        back = inverse(turned)
        moves, turns = group.frame.split(":")
        way = place - origin if moves.startswith("root") else rotate(back, place - origin)
        if not group.asks.turn:
            return _normalised(group, way)
        rest = multiply(turn, back) if turns.startswith("root") else multiply(back, turn)
        return _normalised(group, np.concatenate([way, xyz_angles(rest)]))

    def at(self, state: State) -> Floats:
        """See `PositionDrive`."""
        return state.tcp_pose(self._arm)[0].astype(float)

    def target(self, joints: Floats, state: State) -> Floats:
        """See `PositionDrive`; a TCP that is no link lies beside its link as it does now."""
        robot = self._robot
        places = self._task.simulation.index.joints[self._arm]
        own = dict(zip(robot.joints, joints[places], strict=True))
        place, turn = self._forward(np.array([own[joint] for joint in robot.arm_joints]))
        link = state.link_pose(self.driven.robot, robot.tcp_link)[0].astype(float)
        beside = self.at(state)[:3] - link[:3]
        return np.concatenate([place + rotate(turn, rotate(inverse(link[3:]), beside)), turn])

    @staticmethod
    def shifted(target: Floats, wanted: Floats, reached: Floats, share: float) -> Floats:
        """See `PositionDrive`; each (..., 7)."""
        places = target[..., :3] + share * (wanted[..., :3] - reached[..., :3])
        missed = multiply(wanted[..., 3:], inverse(reached[..., 3:]))
        missed = missed * np.where(missed[..., :1] < 0, -share, share)
        missed[..., 0] += 1 - share
        missed /= np.linalg.norm(missed, axis=-1, keepdims=True)
        return np.concatenate([places, multiply(missed, target[..., 3:])], -1)

    def _root(self, state: State) -> Floats:
        robot, link = self.driven.robot, self.driven.group.root_link
        pose = state.base_pose(robot) if link is None else state.link_pose(robot, link)
        return pose[0].astype(float)


Drive = PositionDrive | VelocityDrive | TcpDrive


def drive_of(driven: DrivenGroup, task: TaskEnv) -> Drive:
    """Return the drive of a group of a task with one environment."""
    asks = driven.group.asks
    if asks.tcp:
        return TcpDrive(driven, task)
    return (PositionDrive if asks.positions else VelocityDrive)(driven, task)


def _normalised(group: JointGroup, values: Floats) -> tuple[Floats, bool]:
    """Return the action numbers of some values, and whether none had to be clipped."""
    if not group.normalised:
        return values, True
    low, high = np.array(group.ranges).T
    numbers = (values - (high + low) / 2) / ((high - low) / 2)
    fits = True
    if group.asks.turn:
        turn = values[3:] / low[-1]  # ManiSkill scales a turn by its lower bound
        length = float(np.linalg.norm(turn))
        numbers[3:] = turn / max(length, 1.0)
        fits = length <= _NEARLY
    return np.clip(numbers, -1, 1), fits and bool((abs(numbers) <= _NEARLY).all())


def _remembered(task: TaskEnv, driven: DrivenGroup, kind: str) -> Floats:
    """Return what a group was last asked for; see `Remembered`."""
    modes = task.simulation.modes
    assert modes is not None
    names = [(kept.robot, kept.group, kept.kind) for kept in modes.remembered]
    return modes.recall()[names.index((driven.robot, driven.name, kind))][0].astype(float)


def _seen_from(root: Floats, pose: Floats) -> tuple[Floats, Floats]:
    """Return place and turn of a pose of the world in the frame of another."""
    back = inverse(root[3:])
    return rotate(back, pose[:3] - root[:3]), multiply(back, pose[3:])
