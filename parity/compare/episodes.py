"""What to play in a comparison: random actions, recorded demonstrations, and arrays of actions."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from robots import CONTROL_MODES
from rollouts.reading.damage import damage_errors
from rollouts.reading.hdf5 import MAX_BYTES
from rollouts.reading.recording import (
    Recording,
    Trajectory,
    TrajectoryError,
    expect_file,
)
from rollouts.reading.summary import MAX_SEED, recorded_task
from tasks import MultiRobotTask
from tasks.episode import Episode

Bounds = Sequence[tuple[float, float]]

SUFFIXES = (".h5", ".npz")

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
        rng = np.random.default_rng(seed)
        actions = rng.uniform(-1, 1, (steps, action_dim))
        actions[wild] *= _OVER_RANGE
        episodes.append(Episode(seed, _scaled(actions, bounds)))
    return episodes


def over_range_episodes(
    seeds: Iterable[int], steps: int, action_dim: int, bounds: Bounds | None = None
) -> list[Episode]:
    """Return episodes of uniform random actions thrice as wide; the arguments are the same."""
    episodes: list[Episode] = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        actions = rng.uniform(-_OVER_RANGE, _OVER_RANGE, (steps, action_dim))
        episodes.append(Episode(seed, _scaled(actions, bounds)))
    return episodes


def load_episodes(path: Path, task_id: str, action_dim: int) -> list[Episode]:
    """Read recorded episodes of a task.

    Two formats are known: ManiSkill's demonstrations (``.h5`` with a ``.json`` beside it), and
    ``.npz`` with ``seeds`` (E,) and the actions ``a0``, ``a1``, … of the episodes, each (T, A).

    Args:
        path: The file.
        task_id: The task the episodes must be for.
        action_dim: Numbers of one action A.

    Raises:
        TrajectoryError: If the file cannot be read or does not fit the task.
    """
    expect_file(path, SUFFIXES)
    if path.suffix == ".h5":
        return _read_h5(path, task_id, action_dim)
    with damage_errors(
        lambda reason: TrajectoryError(f"{path} holds no readable episodes: {reason}")
    ):
        episodes = _read_npz(path)
    if not episodes:
        raise TrajectoryError(f"{path} holds no episodes")
    return [_checked(path, number, episode, action_dim) for number, episode in enumerate(episodes)]


def recorded_episodes(
    path: Path, cls: type[MultiRobotTask], asked: str | None = None
) -> tuple[list[Episode], str]:
    """Read recorded episodes of a task, and the control mode that they are in.

    Args:
        path: The file; see `load_episodes`.
        cls: The task.
        asked: The mode of a file that does not say.

    Raises:
        TrajectoryError: If the file cannot be read, does not fit the task, or its arms are in
            different modes.
    """
    mode = recorded_control_mode(path) or asked or CONTROL_MODES[0]
    width = cls.layout.in_control_mode(mode).action_dim
    return load_episodes(path, cls.task_id, width), mode


def recorded_control_mode(path: Path) -> str | None:
    """Return the control mode that a file was recorded in, or None if it does not say.

    Raises:
        TrajectoryError: If the file cannot be read, or its arms are in different modes.
    """
    if path.suffix != ".h5":
        return None
    with Recording(path) as file:
        mode = file.control_mode
    if not isinstance(mode, str):
        raise TrajectoryError(
            f"{path} was recorded with a control mode for each arm, {dict(mode)}; native ManiSkill"
            " has one for all"
        )
    return mode


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


def _read_h5(path: Path, task_id: str, action_dim: int) -> list[Episode]:
    with Recording(path) as file:
        file.expect(task_id, action_dim)
        return [Episode(_seed(path, trajectory), trajectory.actions) for trajectory in file]


def _seed(path: Path, trajectory: Trajectory) -> int:
    if trajectory.seed is None:
        _refuse(path, f"traj_{trajectory.episode_id}", "it has no reset seed")
    return trajectory.seed


def _read_npz(path: Path) -> list[Episode]:
    with zipfile.ZipFile(path) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > MAX_BYTES:
        raise TrajectoryError(f"{path} unpacks to {size:,} bytes, more than {MAX_BYTES:,}")
    with np.load(path, allow_pickle=False) as data:
        names = sorted(data.files)
        if "seeds" not in data:
            raise TrajectoryError(f"{path} has no array 'seeds'; it has {', '.join(names)}")
        seeds = [int(seed) for seed in np.atleast_1d(data["seeds"])]
        if wrong := [seed for seed in seeds if not 0 <= seed <= MAX_SEED]:
            raise TrajectoryError(f"{path} has the seed {wrong[0]}; it must be 0 to {MAX_SEED}")
        missing = [f"a{i}" for i in range(len(seeds)) if f"a{i}" not in data]
        if missing:
            raise TrajectoryError(
                f"{path} has {len(seeds)} seeds but no actions {', '.join(missing)}"
            )
        return [Episode(seed, data[f"a{i}"]) for i, seed in enumerate(seeds)]


def _checked(path: Path, number: int, episode: Episode, action_dim: int) -> Episode:
    name, actions = f"episode {number}", episode.actions
    if actions.ndim != 2 or actions.shape[1] != action_dim or not len(actions):
        _refuse(path, name, f"its actions have shape {actions.shape}, not (T, {action_dim})")
    if actions.dtype.kind != "f" or not np.isfinite(actions).all():
        _refuse(path, name, "its actions are not all finite floating-point numbers")
    return Episode(episode.seed, actions.astype(np.float32))


def _refuse(path: Path, name: str, why: str) -> NoReturn:
    raise TrajectoryError(f"{name} of {path} cannot be played: {why}")
