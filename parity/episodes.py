"""What to play in a comparison: random actions, recorded demonstrations, and arrays of actions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from robots import RobotLayoutsError, closest_match

CONTROL_MODE = "pd_joint_delta_pos"
SUFFIXES = (".h5", ".npz")

_OVER_RANGE = 3.0  # native clips at 1; a clone has to do the same


class EpisodeFileError(RobotLayoutsError, ValueError):
    """A file of recorded episodes that cannot be read, or is for something else."""


@dataclass(frozen=True)
class Episode:
    """A reset seed and the actions that follow.

    Attributes:
        seed: Reset seed.
        actions: Flat actions, (T, A) float32.
    """

    seed: int
    actions: NDArray[np.float32]


def random_episodes(seeds: Iterable[int], steps: int, action_dim: int) -> list[Episode]:
    """Return episodes of uniform random actions, the third fifth of each drawn from [-3, 3].

    Args:
        seeds: Reset seeds; each also seeds its episode's actions.
        steps: Control steps T of each episode.
        action_dim: Numbers of one action A.
    """
    wild = slice(2 * steps // 5, 3 * steps // 5)
    episodes: list[Episode] = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        actions = rng.uniform(-1, 1, (steps, action_dim))
        actions[wild] *= _OVER_RANGE
        episodes.append(Episode(seed, actions.astype(np.float32)))
    return episodes


def over_range_episodes(seeds: Iterable[int], steps: int, action_dim: int) -> list[Episode]:
    """Return episodes of uniform random actions from [-3, 3]; the arguments are the same."""
    episodes: list[Episode] = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        actions = rng.uniform(-_OVER_RANGE, _OVER_RANGE, (steps, action_dim))
        episodes.append(Episode(seed, actions.astype(np.float32)))
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
        EpisodeFileError: If the file cannot be read or does not fit the task.
    """
    _expect_file(path)
    read = _read_h5 if path.suffix == ".h5" else _read_npz
    try:
        episodes = read(path, task_id)
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        if isinstance(error, RobotLayoutsError):
            raise
        raise EpisodeFileError(f"{path} holds no readable episodes: {error!r}") from error
    if not episodes:
        raise EpisodeFileError(f"{path} holds no episodes")
    return [_checked(path, number, episode, action_dim) for number, episode in enumerate(episodes)]


def recorded_task(path: Path) -> str:
    """Return the id of the task that a demonstration file was recorded in.

    Raises:
        EpisodeFileError: If the file beside it that says so cannot be read.
    """
    return str(_metadata(path)["env_info"]["env_id"])


def find_demonstrations(folder: Path) -> dict[str, list[Path]]:
    """Return the demonstration files below a folder, by task id.

    Raises:
        EpisodeFileError: If there is no such folder, or a file in it cannot be read.
    """
    if not folder.is_dir():
        raise EpisodeFileError(f"there is no folder {folder}")
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*.h5")):
        found.setdefault(recorded_task(path), []).append(path)
    return found


def _read_h5(path: Path, task_id: str) -> list[Episode]:
    import h5py

    recorded = recorded_task(path)
    if recorded != task_id:
        raise EpisodeFileError(f"{path} was recorded in {recorded}, not in {task_id}")
    episodes: list[Episode] = []
    with h5py.File(path) as file:
        for about in _metadata(path)["episodes"]:
            _expect_control_mode(path, about)
            name = f"traj_{about['episode_id']}"
            if name not in file:
                _refuse(path, name, "the json beside it lists it, but it is not in the file")
            trajectory: Any = file[name]
            actions = trajectory["actions"]
            if not isinstance(actions, h5py.Dataset):
                _refuse(path, name, "its actions are not one flat array")
            episodes.append(Episode(_seed(path, about), np.asarray(actions[()])))
    return episodes


def _read_npz(path: Path, task_id: str) -> list[Episode]:
    with np.load(path, allow_pickle=False) as data:
        names = sorted(data.files)
        if "seeds" not in data:
            raise EpisodeFileError(f"{path} has no array 'seeds'; it has {', '.join(names)}")
        seeds = [int(seed) for seed in np.atleast_1d(data["seeds"])]
        missing = [f"a{i}" for i in range(len(seeds)) if f"a{i}" not in data]
        if missing:
            raise EpisodeFileError(
                f"{path} has {len(seeds)} seeds but no actions {', '.join(missing)}"
            )
        return [Episode(seed, data[f"a{i}"]) for i, seed in enumerate(seeds)]


def _metadata(path: Path) -> Mapping[str, Any]:
    beside = path.with_suffix(".json")
    try:
        found = json.loads(beside.read_text())
        missing = {"env_info", "episodes"} - set(found) or {"env_id"} - set(found["env_info"])
    except OSError as error:
        raise EpisodeFileError(
            f"cannot read {beside}, which belongs beside {path.name}: {error.strerror}"
        ) from error
    except (ValueError, TypeError) as error:
        raise EpisodeFileError(f"{beside} is not a demonstration's json: {error!r}") from error
    if missing:
        raise EpisodeFileError(
            f"{beside} is not a demonstration's json: it has no {', '.join(sorted(missing))}"
        )
    return found


def _seed(path: Path, about: Mapping[str, Any]) -> int:
    seed = about.get("reset_kwargs", {}).get("seed")
    if isinstance(seed, list) and len(seed) == 1:
        seed = seed[0]
    if not isinstance(seed, int):
        _refuse(path, f"traj_{about['episode_id']}", f"it has no reset seed (found {seed!r})")
    return seed


def _expect_control_mode(path: Path, about: Mapping[str, Any]) -> None:
    mode = about.get("control_mode", CONTROL_MODE)
    modes = set(mode.values()) if isinstance(mode, dict) else {mode}
    if modes != {CONTROL_MODE}:
        listing = ", ".join(sorted(map(str, modes)))
        _refuse(
            path, f"traj_{about['episode_id']}", f"it was recorded in {listing}, not {CONTROL_MODE}"
        )


def _checked(path: Path, number: int, episode: Episode, action_dim: int) -> Episode:
    name, actions = f"episode {number}", episode.actions
    if actions.ndim != 2 or actions.shape[1] != action_dim or not len(actions):
        _refuse(path, name, f"its actions have shape {actions.shape}, not (T, {action_dim})")
    if actions.dtype.kind != "f" or not np.isfinite(actions).all():
        _refuse(path, name, "its actions are not all finite floating-point numbers")
    return Episode(episode.seed, actions.astype(np.float32))


def _refuse(path: Path, name: str, why: str) -> NoReturn:
    raise EpisodeFileError(f"{name} of {path} cannot be played: {why}")


def _expect_file(path: Path) -> None:
    if not path.is_file():
        siblings = (p.name for p in path.parent.glob("*") if p.suffix in SUFFIXES)
        match = closest_match(path.name, siblings)
        hint = f"; did you mean {path.parent / match}?" if match else ""
        raise EpisodeFileError(f"there is no file {path}{hint}")
    if path.suffix not in SUFFIXES:
        raise EpisodeFileError(
            f"{path} is of an unknown kind {path.suffix!r}; known are {', '.join(SUFFIXES)}"
        )
