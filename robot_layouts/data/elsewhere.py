"""``robot-layouts tasks elsewhere``: other places to stand for the robots of a task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from math import ceil
from typing import Annotated, Any

import numpy as np

from layouts import Frame, Layout, search
from robot_layouts.core.cli import Count, File, Seed, Word
from robot_layouts.core.progress import Progress
from robot_layouts.experts import find_expert
from robot_layouts.experts.reaching import POSE_JOINTS
from robot_layouts.kinematics.rotations import Floats
from robots import LayoutError, TaskError
from tasks import TaskEnv, make
from tasks.cell_options import RecordedCell
from tasks.episode import play
from tasks.language.fitting import TASK

SPOTS = 8  # poses of each TCP that its arm has to reach
# For a task's own robots; with others they are as much larger or smaller as what they do.
_LOW = 0.12  # m above the lowest place of a TCP, that is where its arm works
_APART = 0.04  # m between poses, at least
_CLEAR = 0.1  # m that bases keep from the poses
_SEARCHES, _ENOUGH = 3, 0.8  # at most, until its expert solves that share of episodes from there
_PATIENCE = 1800.0  # s of each search: of many arms, each with many poses, it takes minutes
CLEARANCE = 0.3  # m that robots keep from each other, so that they do not work in each other's way


def stand_elsewhere(
    task: str,
    *,
    seed: int = 0,
    episodes: int = 5,
    clearance: float | None = None,
    tries: int = 4,
    tell: Callable[[str], None] = lambda what: None,
    **making: Any,
) -> Layout:
    """Look for other places from which a task's robots can do what its expert lets them do.

    The expert solves the first episodes where the robots stand. Of each arm the most different
    poses of its TCP, near the lowest, are what it has to reach, or their places if it has fewer
    than six joints; `layouts.search` finds places from which it does, or almost. Then the expert
    plays twice as many episodes from there: if it does not solve four of five, another search
    begins, up to three, and the places from which it solves most are returned. The same arguments
    give the same layout, and `tasks.make` takes it: ``make(task, layout=…)``. Its frame ``task``
    keeps the task where it was.

    Args:
        task: Its id or another of its names.
        seed: Of the search; another one gives other places.
        episodes: How many episodes the expert plays where the robots stand, from seed 0 on, and
            then twice as many from the places found, from seed ``episodes`` on.
        clearance: See `layouts.search`; 0.3 m for a task's own robots if not given, and for smaller
            ones as much less as what they do is smaller.
        tries: See `layouts.search`.
        tell: Told what is done, to show progress.
        making: Arguments of `tasks.make`: ``robots``, ``layout``.

    Raises:
        UnknownNameError: If the task, a place or a robot is unknown.
        TaskError: If the task cannot be made like that, has no expert, or it solves no episode.
        LayoutError: If no other places are found that are clear of each other, or it solves no
            episode from them.
        MissingPackageError: If python-fcl or scipy is not installed.
    """
    with closing(make(task, obs_mode="none", **making)) as env:
        layout, fit = env.layout, env.task.fit
        spots = {
            arm: _most_different(poses, fit.scale)
            for arm, poses in _poses(task, env, range(episodes), tell).items()
        }
    targets = {
        f"{arm} {i}": pose if len(layout.arm(arm).robot.arm_joints) >= POSE_JOINTS else pose[:3]
        for arm, poses in spots.items()
        for i, pose in enumerate(poses)
    }
    reached_by = {f"{arm} {i}": arm for arm, poses in spots.items() for i in range(len(poses))}
    places = np.array([pose[:2] for pose in targets.values()])
    clear = fit.scale * _CLEAR
    low, high = places.min(axis=0) - clear, places.max(axis=0) + clear
    searched = partial(
        search,
        {name: placement.robot for name, placement in layout.items()},
        targets,
        around=(*low.tolist(), *high.tolist()),
        heights={name: placement.base_position[2] for name, placement in layout.items()},
        reached_by=reached_by,
        clearance=fit.scale * CLEARANCE if clearance is None else clearance,
        tries=tries,
        partial=True,  # the expert says whether they do
        patience=_PATIENCE,
    )
    stays = {TASK: Frame((fit.x, fit.y, 0.0), rpy=(0.0, 0.0, fit.yaw))}
    seeds = range(episodes, 3 * episodes)
    best, most = layout, 0
    for number in range(_SEARCHES):
        found = Layout(searched(seed=seed + 1_000 * number), stays)
        solved = _solved(task, found, seeds, tell)
        if solved >= ceil(_ENOUGH * len(seeds)):
            return found
        if solved > most:
            best, most = found, solved
    if not most:
        raise LayoutError(
            f"the expert of {task} does not begin to solve it from the places that {_SEARCHES}"
            " searches found; try another seed, or a larger clearance"
        )
    return best


def _solved(task: str, layout: Layout, seeds: Sequence[int], tell: Callable[[str], None]) -> int:
    """Return how many episodes the expert of a task solves where its robots stand now.

    It stops where they can no longer be enough.
    """
    expert, solved = find_expert(task), 0
    with closing(make(task, layout=layout, obs_mode="none")) as env:
        for number, seed in enumerate(seeds):
            tell(f"from the places found, {solved} of {number} episodes solved")
            try:
                solved += play(env, seed, expert(env, seed)).solved
            except TaskError:  # there is no plan
                pass
            if len(seeds) - (number + 1 - solved) < ceil(_ENOUGH * len(seeds)):
                break
    return solved


def _poses(
    task: str, env: TaskEnv, seeds: Sequence[int], tell: Callable[[str], None]
) -> dict[str, Floats]:
    """Return the poses of each arm's TCP in the episodes that a task's expert solves, (n, 7)."""
    expert = find_expert(task)
    found: dict[str, list[Floats]] = {arm: [] for arm in env.layout.arms}
    for seed in seeds:
        tell(f"the expert's plan of seed {seed}")
        seen: dict[str, list[Floats]] = {arm: [] for arm in env.layout.arms}

        def watch(seen: dict[str, list[Floats]] = seen) -> None:
            state = env.simulation.read()
            for arm, poses in seen.items():
                poses.append(np.asarray(state.tcp_pose(arm)[0], float))

        try:
            solved = play(env, seed, expert(env, seed), watch).solved
        except TaskError:  # there is no plan
            continue
        for arm, poses in seen.items():
            found[arm] += poses if solved else []
    if not any(found.values()):
        raise TaskError(f"the expert of {task} solves none of {len(seeds)} episodes as it stands")
    return {arm: np.array(poses) for arm, poses in found.items()}


def _most_different(poses: Floats, scale: float = 1.0) -> list[tuple[float, ...]]:
    """Return those of an arm's poses, (n, 7), that lie farthest from each other where it works."""
    low = poses[poses[:, 2] < poses[:, 2].min() + scale * _LOW]
    away = np.linalg.norm(low[:, :3] - low[:, :3].mean(axis=0), axis=1)
    chosen = list[Floats]()
    while len(chosen) < SPOTS and (not chosen or away.max() > scale * _APART):
        chosen.append(low[away.argmax()])
        to_it = np.linalg.norm(low[:, :3] - chosen[-1][:3], axis=1)
        away = to_it if len(chosen) == 1 else np.minimum(away, to_it)
    return [tuple(pose.tolist()) for pose in chosen]


def elsewhere(
    task: str,
    *,
    seed: Seed = 0,
    episodes: Count = 5,
    clearance: Annotated[float, Word("M")] | None = None,
    tries: Count = 4,
    out: File | None = None,
    picture: File | None = None,
    cell: RecordedCell,
) -> None:
    """Look for other places from which the robots of a task can do what its expert does.

    `robot-layouts tasks check TASK --layout FILE` shows whether it does.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        seed: Seed of the search; another one gives other places.
        episodes: How many episodes the expert plays to show what has to be reached.
        clearance: Least distance between robots (0.3 for the task's own, less for smaller ones).
        tries: Number of placements to begin from; more take longer.
        out: Write the layout as YAML.
        picture: Save a view (.png, .pdf or .svg).
        cell: Its robots, and where they stand now.

    Raises:
        RobotLayoutsError: If the task cannot be made, its expert solves nothing, or no other places
            are found.
    """
    tell = Progress(work=f"places for {task}").tell
    layout = stand_elsewhere(
        task,
        seed=seed,
        episodes=episodes,
        clearance=clearance,
        tries=tries,
        tell=tell,
        **cell.making(),
    )
    print(layout)
    if out is not None:
        print(f"layout: {layout.save(out)}")
    if picture is not None:
        print(f"picture: {layout.validate().picture(picture)}")
