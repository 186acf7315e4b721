"""Actions of one control mode as those of another: what moved robots there moves them here.

The episode is played in its own mode, which gives each joint group its course: where it was driven
to and where it came. Then it is played in the other mode, where at every step the course is put
into that mode's words, from where the robots are. What came out otherwise is learnt from: the next
try drives a group further by as much as this one missed, step by step, until the task is solved.
Physics repeats itself to the last bit, so that this converges where the mode can move as asked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import inverse, multiply
from rollouts.playing.courses import Course, Drive, Recorded, drives_of
from simulation import State
from tasks import MultiRobotTask
from tasks.episode import REBUILT, follow, moments


class Way(NamedTuple):
    """A way to try.

    Attributes:
        most: Steps that may be taken for one of the recording, where one is too short.
        tries: How often to try.
        share: How much of what a try missed the next one adds.
        shake: How far each try strays from what was learnt, at random (m, rad). Such a try ends
            where the task is solved first, which may be before the recording ends.
    """

    most: int
    tries: int
    share: float
    shake: float = 0.0


# ManiSkill's replay_trajectory takes 4 steps. Where something slips, as what is pushed over a table
# does, the least difference decides when, and each further try is a throw of the dice. Where tries
# come to rest beside what was recorded, as with a ball that rolls on by itself, only straying from
# that throws another.
_WAYS = (
    Way(1, tries=8, share=1.0),
    Way(1, tries=12, share=0.3),
    Way(2, tries=8, share=0.3),
    Way(4, tries=8, share=0.5),
    Way(10, tries=4, share=0.5),
    Way(1, tries=20, share=0.5),
    Way(1, tries=20, share=0.15),
    Way(3, tries=8, share=0.3),
    Way(3, tries=60, share=0.15, shake=3e-3),
)
_SETTLING = 10  # steps at the end, while the task is not solved
_TURNED = 1.0  # degrees; less than that is no turn on purpose


class Attempt(NamedTuple):
    """One try.

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


def converted(
    source: MultiRobotTask, seed: int, actions: NDArray[np.float32], task: MultiRobotTask
) -> NDArray[np.float32]:
    """Return the actions, (T', A'), of `converted_steps`, whose arguments are the same."""
    return converted_steps(source, seed, actions, task)[0]


def converted_steps(
    source: MultiRobotTask, seed: int, actions: NDArray[np.float32], task: MultiRobotTask
) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Return actions for a task that move its robots as some moved those of another.

    Nothing is promised of where they end: play them and look.

    Args:
        source: The same task in the control mode of ``actions``, with one environment.
        seed: The episode.
        actions: Shape (T, A).
        task: The task in another control mode, with one environment; both are stepped.

    Returns:
        The actions, (T', A'), and the step that each stands for, (T',).
    """
    recorded = followed(source, seed, actions)
    drives = drives_of(source, task)
    found = Attempt([], False, [], [])
    random = np.random.default_rng(seed)  # the same actions whenever the episode is converted
    ways = _WAYS if recorded.solved else _WAYS[:1]
    if _lost_turns(recorded, task):  # it may do without them, but learning does not bring them
        ways = ways[:2]
    for way in ways:
        courses = {drive: drive.course(recorded) for drive in drives}
        for _ in range(way.tries):
            tried = {d: d.strayed(course, random, way.shake) for d, course in courses.items()}
            found = _attempt(tried, task, seed, len(actions), way)
            if found.solved:
                return _arrays(found)
            courses = {
                drive: drive.learnt(course, list(map(drive.where, found.states)), way.share)
                for drive, course in courses.items()
            }
    return _arrays(found)


def _arrays(found: Attempt) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    return np.array(found.actions, np.float32), np.array(found.steps, np.intp)


def why_lost(
    source: MultiRobotTask, seed: int, actions: NDArray[np.float32], task: MultiRobotTask
) -> str:
    """Return in words why `converted` solves an episode in no way; its arguments are the same."""
    recorded = followed(source, seed, actions)
    if not recorded.solved:
        return "in its own mode the task is not solved, either"
    if turns := _lost_turns(recorded, task):
        arms = " and ".join(f"{turn:.0f}° ({arm})" for arm, turn in turns.items())
        by = arms if len(task.layout.arms) > 1 else f"{max(turns.values()):.0f}°"
        return f"this mode moves the place of the TCP only; the recording turns it by {by}"
    return f"none of {sum(way.tries for way in _WAYS)} tries solves the task"


def turned(states: Sequence[State], arm: str) -> float:
    """Return how far the TCP of an arm is turned from how it starts, at most (degrees)."""
    ways = np.array([state.tcp_pose(arm)[0, 3:] for state in states], float)
    part = np.abs(multiply(ways, inverse(ways[:1]))[:, 0])
    return float(np.degrees(2 * np.arccos(np.clip(part, 0, 1))).max())


def _lost_turns(recorded: Recorded, task: MultiRobotTask) -> dict[str, float]:
    """Return how far TCPs turn whose mode says where they go, and not how they turn (degrees)."""
    lost: dict[str, float] = {}
    for (robot, name), arm in task.layout.arms_by_group.items():
        asks = task.layout[robot].robot.action_split.groups[name].asks
        if asks.tcp and not asks.turn and (turn := turned(recorded.states, arm)) >= _TURNED:
            lost[arm] = turn
    return lost


def followed(task: MultiRobotTask, seed: int, actions: NDArray[np.float32]) -> Recorded:
    """Play an episode and return where it drove joints."""
    happening = moments(task, seed, follow(actions), len(actions))
    next(happening)
    states, targets = [task.simulation.read()], []
    solved = False
    for moment in happening:
        solved = moment.success
        states.append(task.simulation.read())
        targets.append(task.simulation.drive_targets[0].astype(float))
    return Recorded(np.asarray(actions, np.float32), np.array(targets), states, solved)


def _attempt(
    courses: Mapping[Drive, Course], task: MultiRobotTask, seed: int, steps: int, way: Way
) -> Attempt:
    """Play a task along courses.

    Args:
        courses: Of all that is driven.
        task: Is stepped.
        seed: The episode.
        steps: Of the recording.
        way: How it is tried.
    """
    task.reset(seed, options=REBUILT)
    actions: list[NDArray[np.float32]] = []
    states: list[State] = []
    stands_for: list[int] = []
    solved = False
    for step in range(steps + _SETTLING):
        if solved and (step >= steps or way.shake):
            break
        for _ in range(way.most):
            action, enough = _action(courses, task, min(step, steps - 1))
            actions.append(action)
            stands_for.append(min(step, steps - 1))
            solved = bool(task.advance(action[None])[-1]["success"][0])
            if enough or (solved and way.shake):
                break
        if step < steps:
            states.append(task.simulation.read())
    return Attempt(actions, solved, states, stands_for)


def _action(
    courses: Mapping[Drive, Course], task: MultiRobotTask, step: int
) -> tuple[NDArray[np.float32], bool]:
    """Return the action of one step, (A,), and whether it asks for all that the courses do."""
    state = task.simulation.read()
    action = np.zeros(task.layout.action_dim, np.float32)
    enough = True
    for drive, course in courses.items():
        action[drive.numbers], within = drive.words(course, step, state)
        enough = enough and within
    return action, enough
