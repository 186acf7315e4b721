"""What a joint group was driven to in one control mode, and how another one says so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import inverse, multiply, rotate, rotation_of
from robots import JointGroup
from simulation import State
from tasks import MultiRobotTask

Floats = NDArray[np.float64]

_NEARLY = 1.0 + 1e-4  # of a normalised number that is just at its bound


@dataclass(frozen=True)
class Recorded:
    """What an episode did in its own mode, robots in layout order.

    Attributes:
        numbers: The actions, (T, A).
        targets: What the drives were set to, (T, dof) (rad, m).
        states: The worlds before the first step and after every one, T + 1.
        solved: Whether the task was solved after the last.
    """

    numbers: NDArray[np.float32]
    targets: Floats
    states: Sequence[State]
    solved: bool


@dataclass(frozen=True)
class Course:
    """The course of a joint group, a row for each step: numbers, joints, or poses of its TCP.

    Attributes:
        wanted: What the group is driven to, (T, n).
        passed: Where it was after that, (T, n).
    """

    wanted: Floats
    passed: Floats


@dataclass(frozen=True)
class Part:
    """A joint group of the task that is written for, and the same group in the mode that is read.

    Attributes:
        robot: Name of its robot in the layout.
        name: Its own.
        arm: The robot or limb that it belongs to; None if that has no TCP.
        group: What is driven, and how.
        before: How the other mode does it.
        numbers: Where its numbers stand in an action.
        read: Where they stand in an action of the other mode.
        joints: Where its joints are among those of all robots.
    """

    robot: str
    name: str
    arm: str | None
    group: JointGroup
    before: JointGroup
    numbers: slice
    read: slice
    joints: slice


class Drive(Protocol):
    """Moves one joint group along its course."""

    @property
    def numbers(self) -> slice:
        """Where its numbers stand in an action."""
        ...

    def course(self, recorded: Recorded) -> Course:
        """Return the course that it took in an episode."""
        ...

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """Return the numbers that drive it along its course, and whether they are within bounds.

        Args:
            course: The course.
            step: Which step of it.
            state: The world before the step.
        """
        ...

    def where(self, state: State) -> Floats:
        """Return where it is now, (n,)."""
        ...

    def learnt(self, course: Course, came: Sequence[Floats], share: float) -> Course:
        """Return the course that goes further by a share of what a try missed.

        Args:
            course: What was tried.
            came: Where that led, a row for each step.
            share: How much of it, 0 … 1.
        """
        ...

    def strayed(self, course: Course, random: np.random.Generator, size: float) -> Course:
        """Return a course that strays from one at every step.

        Args:
            course: The course.
            random: Says where to.
            size: How far, as a standard deviation of each number (m, rad).
        """
        ...


def drives_of(source: MultiRobotTask, task: MultiRobotTask) -> list[Drive]:
    """Return what moves each joint group of a task.

    Args:
        source: The same task in the mode that is read.
        task: That in the mode that is written.
    """
    parts = [part for part in _parts(source, task) if part.group.size]
    alike = all(_alike(part) for part in parts)  # so every step is the same to the last bit
    return [
        SameDrive(part)
        if _alike(part) and (alike or not part.group.delta)
        else (TcpDrive if part.group.asks.tcp else JointDrive)(part, task)
        for part in parts
    ]


def _alike(part: Part) -> bool:
    """Tell whether both modes drive a group alike, but for velocities of zero besides."""
    group, before = part.group, part.before
    if group.asks.positions and before.command == "position":
        size = before.size
        group = replace(
            group,
            command="position",
            lower=tuple(low for low, _ in group.ranges[:size]),
            upper=tuple(high for _, high in group.ranges[:size]),
        )
    ranges = {"lower": 0.0, "upper": 1.0}
    return group.ranges == before.ranges and replace(group, **ranges) == replace(before, **ranges)


class SameDrive:
    """A group that both modes drive alike, so that its numbers are copied."""

    def __init__(self, part: Part) -> None:
        """Take the group."""
        self.numbers, self._read = part.numbers, part.read

    def course(self, recorded: Recorded) -> Course:
        """See `Drive`."""
        numbers = recorded.numbers[:, self._read].astype(float)
        zeros = np.zeros((len(numbers), self.numbers.stop - self.numbers.start))
        zeros[:, : numbers.shape[1]] = numbers
        return Course(zeros, zeros)

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """See `Drive`."""
        return course.wanted[step], True

    def where(self, state: State) -> Floats:
        """See `Drive`."""
        return np.zeros(0)

    def learnt(self, course: Course, came: Sequence[Floats], share: float) -> Course:
        """See `Drive`."""
        return course

    def strayed(self, course: Course, random: np.random.Generator, size: float) -> Course:
        """See `Drive`."""
        return course


class JointDrive:
    """A group that is driven by positions of its joints, or by their velocities.

    A drive to a position pulls by stiffness · way − damping · velocity, and one to a velocity by
    damping · (wanted − present). Both pull alike, on the average of a step, if the wanted velocity
    is the way that is left in the middle of the step, times stiffness / damping.
    """

    def __init__(self, part: Part, task: MultiRobotTask) -> None:
        """Take the group."""
        self.numbers, self._part, self._task = part.numbers, part, task
        self._by_speed = part.group.asks.velocities and not part.group.asks.positions
        self._rate = _rates(part, task.scenario.control_frequency)

    def course(self, recorded: Recorded) -> Course:
        """See `Drive`."""
        part = self._part
        joints = np.array([self.where(state) for state in recorded.states])
        wanted = _pulled_to(part, recorded, joints, self._rate)
        if self._by_speed:
            wanted = wanted - np.diff(joints, axis=0) / 2
        return Course(wanted, joints[1:])

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """See `Drive`."""
        group, wanted = self._part.group, course.wanted[step]
        if self._by_speed:
            return _normalised(group, (wanted - self.where(state)) * self._rate)
        if group.delta:
            kept = group.target and _remembered(self._task, self._part, "target_qpos")
            wanted = wanted - (kept if group.target else self.where(state))
        if group.mimic:
            multiplier, offset = group.followers[0]
            wanted = (wanted[:1] - (0.0 if group.delta else offset)) / multiplier
        if group.asks.velocities:  # a drive to positions brakes by itself
            wanted = np.concatenate([wanted, np.zeros(len(group.joints))])
        return _normalised(group, wanted)

    def where(self, state: State) -> Floats:
        """See `Drive`."""
        return state.joint_positions[0, self._part.joints].astype(float)

    def learnt(self, course: Course, came: Sequence[Floats], share: float) -> Course:
        """See `Drive`."""
        return Course(course.wanted + share * (course.passed - came), course.passed)

    def strayed(self, course: Course, random: np.random.Generator, size: float) -> Course:
        """See `Drive`."""
        return _beside(course, random, size, course.wanted.shape[1])


class TcpDrive:
    """A group that is driven by where its TCP is to be, in the world."""

    def __init__(self, part: Part, task: MultiRobotTask) -> None:
        """Take the group."""
        assert part.arm is not None
        self.numbers, self._part, self._task, self._arm = part.numbers, part, task, part.arm
        self._robot = task.layout.arm(part.arm).robot
        self._forward = task.simulation.point_reach(part.arm).forward

    def course(self, recorded: Recorded) -> Course:
        """See `Drive`."""
        part = self._part
        joints = np.array([s.joint_positions[0].astype(float) for s in recorded.states])
        targets = recorded.targets.copy()
        rate = _rates(part, self._task.scenario.control_frequency)
        targets[:, part.joints] = _pulled_to(part, recorded, joints[:, part.joints], rate)
        after = recorded.states[1:]
        wanted = [self._pose(row, state) for row, state in zip(targets, after, strict=True)]
        return Course(np.array(wanted), np.array([self.where(state) for state in after]))

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """See `Drive`."""
        group, root = self._part.group, self._root(state)
        place, turn = _seen_from(root, course.wanted[step])
        if not group.delta:
            return _normalised(group, np.concatenate([place, _angles(turn)]))
        if group.target:
            before = _remembered(self._task, self._part, "target_pose")
            before, ways = before[:3], before[3:]
        else:
            before, ways = _seen_from(root, self.where(state))
        moves, turns = group.frame.split(":")
        way = place - before
        way = way if moves.startswith("root") else rotate(inverse(ways), way)
        if not group.asks.turn:
            return _normalised(group, way)
        back = inverse(ways)
        rest = multiply(turn, back) if turns.startswith("root") else multiply(back, turn)
        return _normalised(group, np.concatenate([way, _angles(rest)]))

    def where(self, state: State) -> Floats:
        """See `Drive`."""
        return state.tcp_pose(self._arm)[0].astype(float)

    def learnt(self, course: Course, came: Sequence[Floats], share: float) -> Course:
        """See `Drive`."""
        return Course(_further(course.wanted, course.passed, np.array(came), share), course.passed)

    def strayed(self, course: Course, random: np.random.Generator, size: float) -> Course:
        """See `Drive`."""
        return _beside(course, random, size, 3)  # its place, not its turn

    # -- inside ------------------------------------------------------------------------------

    def _pose(self, targets: Floats, state: State) -> Floats:
        """Return the TCP pose that joint targets stand for, (7,)."""
        robot = self._robot
        places = self._task.simulation.index.joints[self._arm]
        own = dict(zip(robot.joints, targets[places], strict=True))
        place, turn = self._forward(np.array([own[joint] for joint in robot.arm_joints]))
        link = state.link_pose(self._part.robot, robot.tcp_link)[0].astype(float)
        beside = self.where(state)[:3] - link[:3]
        return np.concatenate([place + rotate(turn, rotate(inverse(link[3:]), beside)), turn])

    def _root(self, state: State) -> Floats:
        robot, link = self._part.robot, self._part.group.root_link
        pose = state.base_pose(robot) if link is None else state.link_pose(robot, link)
        return pose[0].astype(float)


def _parts(source: MultiRobotTask, task: MultiRobotTask) -> Iterator[Part]:
    arms = task.layout.arms_by_group
    number = read = joint = 0
    for robot, placement in task.layout.items():
        earlier: Mapping[str, JointGroup] = source.layout[robot].robot.action_split.groups
        for name, group in placement.robot.action_split.groups.items():
            before = earlier[name]
            yield Part(
                robot,
                name,
                arms.get((robot, name)),
                group,
                before,
                slice(number, number + group.size),
                slice(read, read + before.size),
                slice(joint, joint + len(group.joints)),
            )
            number, read = number + group.size, read + before.size
            joint += len(group.joints)


def _rates(part: Part, frequency: float) -> Floats:
    """Return stiffness / damping of each joint (1/s), of the mode that has a stiffness."""
    before, after = part.before.drives, part.group.drives
    pairs = [a[:2] if a[0] else b[:2] for a, b in zip(after, before, strict=True)]
    return np.array([k / d if k and d else frequency for k, d in pairs])


def _pulled_to(part: Part, recorded: Recorded, joints: Floats, rate: Floats) -> Floats:
    """Return the positions that an episode's drives pulled to, whatever it asked for, (T, n).

    Args:
        part: The group.
        recorded: The episode.
        joints: Where they were, (T + 1, n).
        rate: See `_rates`.
    """
    asks = part.before.asks
    wanted = recorded.targets[:, part.joints]
    if not asks.velocities:
        return wanted
    numbers = recorded.numbers[:, part.read][:, -len(part.before.joints) :]
    low, high = np.array(part.before.ranges[-len(part.before.joints) :]).T
    if part.before.normalised:
        numbers = (high + low) / 2 + (high - low) / 2 * np.clip(numbers, -1, 1)
    middle = wanted if asks.positions else (joints[1:] + joints[:-1]) / 2
    return middle + numbers / rate


def _remembered(task: MultiRobotTask, part: Part, kind: str) -> Floats:
    modes = task.simulation.modes
    assert modes is not None
    names = [(kept.robot, kept.group, kept.kind) for kept in modes.remembered]
    return modes.recall()[names.index((part.robot, part.name, kind))][0].astype(float)


def _normalised(group: JointGroup, values: Floats) -> tuple[Floats, bool]:
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


def _beside(course: Course, random: np.random.Generator, size: float, count: int) -> Course:
    """Return a course of which the first numbers of each step are others, at random."""
    if not size:
        return course
    wanted = course.wanted.copy()
    wanted[:, :count] += random.normal(0.0, size, (len(wanted), count))
    return Course(wanted, course.passed)


def _further(wanted: Floats, passed: Floats, own: Floats, share: float) -> Floats:
    """Return poses further by a share of what some miss of others, (..., 7)."""
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
