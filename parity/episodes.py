"""What to play in a comparison: random actions, recorded demonstrations, and experts' plans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tasks
from robot_layouts.data.reading.json_files import TrajectoryError, recorded_task
from robot_layouts.data.reading.recording import Recording
from robot_layouts.experts import find_expert
from robots import CONTROL_MODES, TaskError
from tasks import MultiRobotTask
from tasks.episode import Episode

Bounds = Sequence[tuple[float, float]]
_OVER_RANGE = 3.0  # native clips normalised actions; a clone has to do the same


def random_episodes(
    seeds: Iterable[int], steps: int, action_dim: int, bounds: Bounds | None = None
) -> list[Episode]:
    """Return episodes of uniform random actions, the third fifth of each thrice as wide.

    Args:
        seeds: Reset seeds; each also seeds its episode's actions.
        steps: Control steps T of each episode.
        action_dim: Numbers of one action A.
        bounds: The least and the largest value of each number; [-1, 1] if None.
    """
    wild = slice(2 * steps // 5, 3 * steps // 5)
    episodes: list[Episode] = []
    for seed in seeds:
        actions = np.random.default_rng(seed).uniform(-1, 1, (steps, action_dim))
        actions[wild] *= _OVER_RANGE
        episodes.append(Episode(seed, _scaled(actions, bounds)))
    return episodes


def over_range_episodes(
    seeds: Iterable[int], steps: int, action_dim: int, bounds: Bounds | None = None
) -> list[Episode]:
    """Return episodes of uniform random actions thrice as wide; the arguments are the same."""
    shape, wide = (steps, action_dim), (-_OVER_RANGE, _OVER_RANGE)
    return [
        Episode(seed, _scaled(np.random.default_rng(seed).uniform(*wide, shape), bounds))
        for seed in seeds
    ]


def load_episodes(path: Path, task_id: str, action_dim: int) -> list[Episode]:
    """Read recorded episodes of a task from a recording, ManiSkill's or ours.

    Args:
        path: The ``.h5`` file, with a ``.json`` beside it.
        task_id: The task the episodes must be for.
        action_dim: Numbers of one action A.

    Raises:
        TrajectoryError: If the file cannot be read or does not fit the task.
    """
    episodes: list[Episode] = []
    with Recording(path) as file:
        file.expect(task_id, action_dim)
        for recorded in file:
            if recorded.seed is None:
                name = f"traj_{recorded.episode_id}"
                raise TrajectoryError(f"{name} of {path} cannot be played: it has no reset seed")
            episodes.append(Episode(recorded.seed, recorded.actions))
    return episodes


@dataclass(frozen=True)
class Source:
    """Episodes of a task, and where they come from.

    Attributes:
        name: In a few words.
        episodes: What to play.
        control_mode: What actions mean, one of `robots.CONTROL_MODES`.
    """

    name: str
    episodes: tuple[Episode, ...]
    control_mode: str = CONTROL_MODES[0]


def recorded_source(path: Path, cls: type[MultiRobotTask], asked: str | None = None) -> Source:
    """Read recorded episodes of a task.

    Args:
        path: The file; see `load_episodes`.
        cls: The task.
        asked: The control mode that it should be in, if any.

    Raises:
        TrajectoryError: If the file cannot be read, does not fit the task, or its arms are in
            different modes.
        TaskError: If it is in another mode than was asked for.
    """
    with Recording(path) as file:
        mode = file.control_mode
    if not isinstance(mode, str):
        raise TrajectoryError(
            f"{path} was recorded with a control mode for each arm, {dict(mode)}; native ManiSkill"
            " has one for all"
        )
    if asked not in (None, mode):
        raise TaskError(f"{path} was recorded in {mode}; leave --control-mode {asked} out")
    width = cls.layout.in_control_mode(mode).action_dim
    name = f"{path.absolute().parent.name}/{path.name.split('.')[0]}"
    return Source(name, tuple(load_episodes(path, cls.task_id, width)), mode)


def expert_source(cls: type[MultiRobotTask], seeds: Iterable[int]) -> Source:
    """Return what a task's expert does with some seeds.

    Raises:
        TaskError: If the task has no expert.
    """
    expert = find_expert(cls.task_id)
    with closing(tasks.make(cls.task_id)) as env:
        planned = [Episode(seed, np.asarray(expert(env, seed), np.float32)) for seed in seeds]
    return Source("expert", tuple(planned))


def find_demonstrations(folder: Path) -> dict[str, list[Path]]:
    """Return the demonstration files below a folder, by task id.

    Raises:
        TrajectoryError: If there is no such folder, or a file in it cannot be read.
    """
    if not folder.is_dir():
        raise TrajectoryError(f"there is no folder {folder}")
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*.h5")):
        found.setdefault(recorded_task(path), []).append(path)
    return found


def _scaled(actions: NDArray[np.float64], bounds: Bounds | None) -> NDArray[np.float32]:
    """Map [-1, 1] onto bounds."""
    if bounds is not None:
        low, high = np.array(bounds).T
        actions = (high + low) / 2 + (high - low) / 2 * actions
    return actions.astype(np.float32)
