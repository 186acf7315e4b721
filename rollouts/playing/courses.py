"""What a joint group was driven to in one control mode, and how another one says so."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robots import JointGroup
from simulation import State
from tasks import MultiRobotTask
from tasks.driving import DrivenGroup, JointNumbers, TcpNumbers, driven_groups, further

Floats = NDArray[np.float64]


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
        driven: The group.
        before: How the other mode drives it.
        read: Where its numbers stand in an action of the other mode.
    """

    driven: DrivenGroup
    before: JointGroup
    read: slice


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
    parts = [part for part in _parts(source, task) if part.driven.group.size]
    alike = all(_alike(part) for part in parts)  # so every step is the same to the last bit
    return [
        SameDrive(part)
        if _alike(part) and (alike or not part.driven.group.delta)
        else (TcpDrive if part.driven.group.asks.tcp else JointDrive)(part, task)
        for part in parts
    ]


def _alike(part: Part) -> bool:
    """Tell whether both modes drive a group alike, but for velocities of zero besides."""
    group, before = part.driven.group, part.before
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
        self.numbers, self._read = part.driven.numbers, part.read

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
        self.numbers, self._part = part.driven.numbers, part
        self._numbers = JointNumbers(part.driven, task)
        self._rate = _rates(part, task.scenario.control_frequency)

    def course(self, recorded: Recorded) -> Course:
        """See `Drive`."""
        joints = np.array([self.where(state) for state in recorded.states])
        wanted = _pulled_to(self._part, recorded, joints, self._rate)
        if self._numbers.by_speed:
            wanted = wanted - np.diff(joints, axis=0) / 2
        return Course(wanted, joints[1:])

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """See `Drive`."""
        wanted = course.wanted[step]
        if self._numbers.by_speed:
            wanted = (wanted - self.where(state)) * self._rate
        return self._numbers.towards(wanted, state)

    def where(self, state: State) -> Floats:
        """See `Drive`."""
        return self._numbers.where(state)

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
        self.numbers, self._part = part.driven.numbers, part
        self._numbers = TcpNumbers(part.driven, task)
        self._rate = _rates(part, task.scenario.control_frequency)

    def course(self, recorded: Recorded) -> Course:
        """See `Drive`."""
        own = self._part.driven.joints
        joints = np.array([s.joint_positions[0].astype(float) for s in recorded.states])
        targets = recorded.targets.copy()
        targets[:, own] = _pulled_to(self._part, recorded, joints[:, own], self._rate)
        after = recorded.states[1:]
        wanted = [self._numbers.pose(row, s) for row, s in zip(targets, after, strict=True)]
        return Course(np.array(wanted), np.array([self.where(state) for state in after]))

    def words(self, course: Course, step: int, state: State) -> tuple[Floats, bool]:
        """See `Drive`."""
        return self._numbers.towards(course.wanted[step], state)

    def where(self, state: State) -> Floats:
        """See `Drive`."""
        return self._numbers.where(state)

    def learnt(self, course: Course, came: Sequence[Floats], share: float) -> Course:
        """See `Drive`."""
        return Course(further(course.wanted, course.passed, np.array(came), share), course.passed)

    def strayed(self, course: Course, random: np.random.Generator, size: float) -> Course:
        """See `Drive`."""
        return _beside(course, random, size, 3)  # its place, not its turn


def _parts(source: MultiRobotTask, task: MultiRobotTask) -> Iterator[Part]:
    groups = zip(driven_groups(task.layout), driven_groups(source.layout), strict=True)
    for driven, before in groups:
        yield Part(driven, before.group, before.numbers)


def _rates(part: Part, frequency: float) -> Floats:
    """Return stiffness / damping of each joint (1/s), of the mode that has a stiffness."""
    before, after = part.before.drives, part.driven.group.drives
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
    wanted = recorded.targets[:, part.driven.joints]
    if not asks.velocities:
        return wanted
    numbers = recorded.numbers[:, part.read][:, -len(part.before.joints) :]
    low, high = np.array(part.before.ranges[-len(part.before.joints) :]).T
    if part.before.normalised:
        numbers = (high + low) / 2 + (high - low) / 2 * np.clip(numbers, -1, 1)
    middle = wanted if asks.positions else (joints[1:] + joints[:-1]) / 2
    return middle + numbers / rate


def _beside(course: Course, random: np.random.Generator, size: float, count: int) -> Course:
    """Return a course of which the first numbers of each step are others, at random."""
    if not size:
        return course
    wanted = course.wanted.copy()
    wanted[:, :count] += random.normal(0.0, size, (len(wanted), count))
    return Course(wanted, course.passed)
