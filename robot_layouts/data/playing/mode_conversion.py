"""Actions of one control mode as those of another: what moved robots there moves them here.

The episode is played in its own mode, which gives each joint group its reference: what it was
driven to and where it was after that. Then it is played in the other mode, with the action at each
step that drives from where the robots are to the reference. The next attempt drives a group further
by as much as this one missed, step by step, until the task is solved: iterative learning control.
Physics repeats itself to the last bit, so that this converges where the mode can move as asked.

Experts plan in deltas; `Planner` converts what they plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.registry import Expert
from robot_layouts.experts.rehearsal import rehearsed
from robot_layouts.kinematics.rotations import Floats, inverse, multiply
from robot_layouts.simulation import State
from robots import CONTROL_MODES, JointGroup, TaskError
from tasks import TaskEnv
from tasks.driving import DrivenGroup, TcpDrive, VelocityDrive, drive_of, driven_groups
from tasks.engine import outcome
from tasks.episode import REBUILT, PlayedEpisode, moments, open_loop

_SETTLING = 10  # steps at the end, while the task is not solved
_TURNED = 1.0  # degrees; less than that is no turn on purpose

DELTAS, POSITIONS = CONTROL_MODES[:2]  # all experts plan in deltas


class Schedule(NamedTuple):
    """Some attempts that go on from one another.

    Attributes:
        max_steps: Steps that may be taken for one of the recording, where one is too short.
        attempts: How many there are.
        gain: Share of what an attempt missed that the next one adds.
        noise: Standard deviation of what is added to each number of the references at random
            (m, rad). Such an attempt ends as soon as the task is solved.
    """

    max_steps: int
    attempts: int
    gain: float
    noise: float = 0.0


# How many of 1,008 conversions each solved that those before had not: recordings of the experts of
# 17 tasks in 8 modes, 3 seeds of each, and 600 of PegInsertionSide, PullCubeTool, PushT, RollBall.
_SCHEDULES = (
    Schedule(1, attempts=8, gain=1.0),  # 971, nearly all at once: the modes can move alike
    Schedule(1, attempts=12, gain=0.3),  # 10 of PushT: what slips overreacts to a whole correction
    Schedule(2, attempts=8, gain=0.3),  # 15: bounds of relative TCP poses are narrower than steps
    Schedule(4, attempts=8, gain=0.5),  # 4, likewise; ManiSkill's replay_trajectory takes 4 steps
    Schedule(10, attempts=4, gain=0.5),  # none of these; for modes of still narrower bounds
    Schedule(1, attempts=20, gain=0.5),  # 3 of PushT, whose attempts scatter: more of them help
    Schedule(1, attempts=20, gain=0.15),  # 1 of PushT, likewise
    Schedule(3, attempts=8, gain=0.3),  # 1 of PushT, likewise
    # 2, of PushT and RollBall, whose attempts had come to rest beside the recording. One of PushT
    # was given up before, after 150 s.
    Schedule(3, attempts=60, gain=0.15, noise=3e-3),
)


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


class Reference(NamedTuple):
    """What a joint group follows, a row for each step: numbers, joints, or poses of its TCP.

    Attributes:
        targets: What the group is driven to, (T, n).
        reached: Where it is to be after that, (T, n).
    """

    targets: Floats
    reached: Floats


class _Attempt(NamedTuple):
    """One attempt.

    Attributes:
        actions: What was done, a row for each step.
        solved: Whether the task was solved after the last.
        states: After what stands for each step of the recording.
        steps: Which step of the recording each action stands for.
    """

    actions: list[NDArray[np.float32]]
    solved: bool
    states: list[State]
    steps: list[int]


def converted_steps(
    source: TaskEnv, seed: int, actions: NDArray[np.float32], task: TaskEnv
) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Return actions for a task that move its robots as some moved those of another.

    Nothing is promised of where they end: play them to see.

    Args:
        source: The same task in the control mode of ``actions``, with one environment.
        seed: The episode.
        actions: Shape (T, A).
        task: The task in another control mode, with one environment; both are stepped.

    Returns:
        The actions, (T', A'), and the step that each stands for, (T',).
    """
    recorded = followed(source, seed, actions)
    groups = _groups(source, task)
    found = _Attempt([], False, [], [])
    random = np.random.default_rng(seed)  # the same actions whenever the episode is converted
    schedules = _SCHEDULES if recorded.solved else _SCHEDULES[:1]
    if _lost_turns(recorded, task):  # it may do without them, but learning does not bring them
        schedules = schedules[:2]
    for schedule in schedules:
        references = {group: group.reference(recorded) for group in groups}
        for _ in range(schedule.attempts):
            tried = {g: g.disturbed(own, random, schedule.noise) for g, own in references.items()}
            found = _attempt(tried, task, seed, len(actions), schedule)
            if found.solved:
                return _arrays(found)
            references = {
                group: group.learned(own, found.states, schedule.gain)
                for group, own in references.items()
            }
    return _arrays(found)


def _arrays(found: _Attempt) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    return np.array(found.actions, np.float32), np.array(found.steps, np.intp)


def why_lost(source: TaskEnv, seed: int, actions: NDArray[np.float32], task: TaskEnv) -> str:
    """Return why `converted_steps` does not solve an episode; its arguments are the same."""
    recorded = followed(source, seed, actions)
    if not recorded.solved:
        return "in its own mode the task is not solved, either"
    if turns := _lost_turns(recorded, task):
        arms = " and ".join(f"{turn:.0f}° ({arm})" for arm, turn in turns.items())
        by = arms if len(task.layout.arms) > 1 else f"{max(turns.values()):.0f}°"
        return f"this mode moves the place of the TCP only; the recording turns it by {by}"
    return f"none of {sum(schedule.attempts for schedule in _SCHEDULES)} tries solves the task"


def turned(states: Sequence[State], arm: str) -> float:
    """Return how far the TCP of an arm is turned from how it starts, at most (degrees)."""
    ways = np.array([state.tcp_pose(arm)[0, 3:] for state in states], float)
    part = np.abs(multiply(ways, inverse(ways[:1]))[:, 0])
    return float(np.degrees(2 * np.arccos(np.clip(part, 0, 1))).max())


def _lost_turns(recorded: Recorded, task: TaskEnv) -> dict[str, float]:
    """Return how far TCPs turn whose mode says where they go, and not how they turn (degrees)."""
    lost: dict[str, float] = {}
    for (robot, name), arm in task.layout.arms_by_group.items():
        asks = task.layout[robot].robot.action_split.groups[name].asks
        if asks.tcp and not asks.turn and (turn := turned(recorded.states, arm)) >= _TURNED:
            lost[arm] = turn
    return lost


def followed(task: TaskEnv, seed: int, actions: NDArray[np.float32]) -> Recorded:
    """Play an episode and return what it drove joints to."""
    playing = moments(task, seed, open_loop(actions), len(actions))
    next(playing)
    states, targets = [task.simulation.read()], []
    solved = False
    for moment in playing:
        solved = moment.success
        states.append(task.simulation.read())
        targets.append(task.simulation.drive_targets[0].astype(float))
    return Recorded(np.asarray(actions, np.float32), np.array(targets), states, solved)


def _attempt(
    references: Mapping[_ConvertedGroup, Reference],
    task: TaskEnv,
    seed: int,
    steps: int,
    schedule: Schedule,
) -> _Attempt:
    """Play a task along the references of its groups, for some steps of the recording."""
    task.reset(seed, options=REBUILT)
    found = _Attempt([], False, [], [])
    solved = False
    for step in range(steps + _SETTLING):
        if solved and (step >= steps or schedule.noise):
            break
        row = min(step, steps - 1)
        for _ in range(schedule.max_steps):
            action, enough = _action(references, task, row)
            found.actions.append(action)
            found.steps.append(row)
            solved = bool(outcome.solved(task.advance(action[None])[-1])[0])
            if enough or (solved and schedule.noise):
                break
        if step < steps:
            found.states.append(task.simulation.read())
    return found._replace(solved=solved)


def _action(
    references: Mapping[_ConvertedGroup, Reference], task: TaskEnv, step: int
) -> tuple[NDArray[np.float32], bool]:
    """Return the action of one step, (A,), and whether it drives all the way to the references."""
    state = task.simulation.read()
    action = np.zeros(task.layout.action_dim, np.float32)
    enough = True
    for group, reference in references.items():
        action[group.numbers], within = group.toward(reference, step, state)
        enough = enough and within
    return action, enough


def _groups(source: TaskEnv, task: TaskEnv) -> list[_ConvertedGroup]:
    """Return the joint groups of a task.

    Args:
        source: The same task in the mode that is read.
        task: That in the mode that is written.
    """
    pairs = zip(driven_groups(task.layout), driven_groups(source.layout), strict=True)
    parts = [(after, before) for after, before in pairs if after.group.size]
    alike = [_alike(after.group, before.group) for after, before in parts]
    return [
        # Relative numbers mean the same only where every step is the same to the last bit.
        _Copied(after, before)
        if same and (all(alike) or not after.group.delta)
        else _ConvertedGroup(after, before, task)
        for (after, before), same in zip(parts, alike, strict=True)
    ]


def _alike(group: JointGroup, before: JointGroup) -> bool:
    """Tell whether two modes drive a group alike, but for velocities of zero besides."""
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


class _ConvertedGroup:
    """A joint group of the task that is written, and the same group in the mode that is read.

    A drive to a position pulls by stiffness · way − damping · velocity, and one to a velocity by
    damping · (wanted − present). Both pull alike, on the average of a step, if the wanted velocity
    is the way that is left in the middle of the step, times stiffness / damping.
    """

    def __init__(self, after: DrivenGroup, before: DrivenGroup, task: TaskEnv) -> None:
        self.numbers, self._before, self._joints = after.numbers, before, after.joints
        self._drive = drive_of(after, task)
        self._by_speed = isinstance(self._drive, VelocityDrive)
        # Stiffness / damping of each joint (1/s), of the mode that has a stiffness.
        pairs = zip(after.group.drives, before.group.drives, strict=True)
        rates = [a[:2] if a[0] else b[:2] for a, b in pairs]
        frequency = task.scenario.control_frequency
        self._rate = np.array([k / d if k and d else frequency for k, d in rates])

    def reference(self, recorded: Recorded) -> Reference:
        """Return the reference that the group followed in an episode."""
        joints = np.array([s.joint_positions[0].astype(float) for s in recorded.states])
        own, targets = joints[:, self._joints], recorded.targets.copy()
        targets[:, self._joints] = self._pulled_to(recorded, own)
        after = recorded.states[1:]
        rows = zip(targets, after, strict=True)
        wanted = np.array([self._drive.target(row, state) for row, state in rows])
        if self._by_speed:
            wanted = wanted - np.diff(own, axis=0) / 2
        return Reference(wanted, self._reached(after))

    def toward(self, reference: Reference, step: int, state: State) -> tuple[Floats, bool]:
        """Return the numbers that drive to a step of a reference, and whether all the way."""
        target = reference.targets[step]
        if self._by_speed:
            target = (target - self._drive.at(state)) * self._rate
        return self._drive.toward(target, state)

    def learned(self, reference: Reference, states: Sequence[State], gain: float) -> Reference:
        """Return the reference that goes further by a share of what an attempt missed."""
        reached = self._reached(states)
        targets = self._drive.shifted(reference.targets, reference.reached, reached, gain)
        return reference._replace(targets=targets)

    def disturbed(
        self, reference: Reference, random: np.random.Generator, noise: float
    ) -> Reference:
        """Return a reference with noise on its joints, or on the place of its TCP."""
        if not noise:
            return reference
        targets = reference.targets.copy()
        count = 3 if isinstance(self._drive, TcpDrive) else targets.shape[1]
        targets[:, :count] += random.normal(0.0, noise, (len(targets), count))
        return reference._replace(targets=targets)

    def _reached(self, states: Sequence[State]) -> Floats:
        return np.array([self._drive.at(state) for state in states])

    def _pulled_to(self, recorded: Recorded, joints: Floats) -> Floats:
        """Return the positions that an episode's drives pulled to, whatever its mode, (T, n)."""
        group, numbers = self._before.group, recorded.numbers[:, self._before.numbers]
        targets = recorded.targets[:, self._joints]
        if not group.asks.velocities:
            return targets
        numbers = numbers[:, -len(group.joints) :]
        low, high = np.array(group.ranges[-len(group.joints) :]).T
        if group.normalised:
            numbers = (high + low) / 2 + (high - low) / 2 * np.clip(numbers, -1, 1)
        middle = targets if group.asks.positions else (joints[1:] + joints[:-1]) / 2
        return middle + numbers / self._rate


class _Copied(_ConvertedGroup):
    """A group that both modes drive alike, so that its numbers are copied."""

    def __init__(self, after: DrivenGroup, before: DrivenGroup) -> None:
        self.numbers, self._before = after.numbers, before

    def reference(self, recorded: Recorded) -> Reference:
        numbers = recorded.numbers[:, self._before.numbers].astype(float)
        zeros = np.zeros((len(numbers), self.numbers.stop - self.numbers.start))
        zeros[:, : numbers.shape[1]] = numbers
        return Reference(zeros, zeros)

    def toward(self, reference: Reference, step: int, state: State) -> tuple[Floats, bool]:
        return reference.targets[step], True

    def learned(self, reference: Reference, states: Sequence[State], gain: float) -> Reference:
        return reference

    def disturbed(
        self, reference: Reference, random: np.random.Generator, noise: float
    ) -> Reference:
        return reference


class Planner:
    """What an expert does in the episodes of a task, in the task's control mode.

    Attributes:
        reason: Why its last plan does not solve the episode, in words, if the expert says so.
        rehearsed: The episode of its last plan, if that has happened already; see
            `robot_layouts.experts.rehearsal.rehearsed`.
    """

    def __init__(self, task: TaskEnv, expert: Expert) -> None:
        """Make a task in deltas for the expert to plan for, if this one is in another mode."""
        self._task, self._expert, self._played, self.reason = task, expert, task, ""
        self.rehearsed: PlayedEpisode | None = None
        self._converts = task.control_mode != DELTAS
        if self._converts:
            self._task = task.task_class(replace(task.scenario, control_mode=DELTAS))

    def __call__(self, seed: int) -> NDArray[np.float32]:
        """Return the actions (T, A) of the episode that ``seed`` begins.

        In positions they move everything as planned, to the last bit; in other modes nearly, and
        the task is stepped to find them.
        """
        actions = self._expert(self._task, seed)
        self.reason = getattr(actions, "reason", "")
        if not self._converts:
            self.rehearsed = rehearsed(self._task, seed, actions)
            return actions
        if self._played.control_mode == POSITIONS:
            return as_positions(self._task, seed, actions)
        return converted_steps(self._task, seed, actions, self._played)[0]

    def close(self) -> None:
        """Let the worlds of its own task go, if it made one."""
        if self._converts:
            self._task.close()


def as_positions(task: TaskEnv, seed: int, actions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the actions in ``pd_joint_pos`` that move everything as these do, to the last bit.

    The episode is played once, and the drive targets of each step are kept.

    Args:
        task: A task with one environment in ``pd_joint_delta_pos``.
        seed: The episode.
        actions: Shape (T, A).

    Returns:
        Shape (T, A): joint positions for every group that was relative (rad, m), the other
        numbers as they are.

    Raises:
        TaskError: If the task is in another control mode.
    """
    if task.control_mode != DELTAS:
        raise TaskError(f"actions of {DELTAS} are converted; the task has {task.control_mode}")
    positions = np.array(actions, np.float32)
    targets = followed(task, seed, positions).targets
    for driven in driven_groups(task.layout):
        if driven.group.delta:
            positions[:, driven.numbers] = targets[:, driven.joints][:, : driven.group.size]
    return positions
