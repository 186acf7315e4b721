"""Reads recorded episodes: ManiSkill's trajectory format, h5 with a json beside it."""

from __future__ import annotations

import json
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn, TypeVar, overload

import h5py
import numpy as np
from numpy.typing import NDArray

from robots import CONTROL_MODES, RobotLayoutsError, closest_match
from rollouts.episode import States
from rollouts.provenance import describe_layout, describe_simulation, differences, listing
from tasks import MultiRobotTask

_FLAGS = ("success", "terminated", "truncated")

Number = TypeVar("Number", np.float32, np.bool_)


class TrajectoryError(RobotLayoutsError, ValueError):
    """A file of recorded episodes that cannot be read, or is for something else."""


@dataclass(frozen=True)
class Trajectory:
    """One recorded episode of T steps.

    Attributes:
        episode_id: Its number in the file.
        seed: Seed of its reset; None if the file names none, or several.
        control_mode: ``"pd_joint_delta_pos"`` or ``"pd_joint_pos"``.
        actions: Flat actions, (T, A).
        states: State dict of `MultiRobotTask.get_state_dict`, each entry (T + 1, k), the first
            row being the state after the reset; None if the file holds none.
        rewards: Shape (T,), or None if the file holds none.
        success: Shape (T,), or None.
        terminated: Shape (T,), or None.
        truncated: Shape (T,), or None.
        rebuilt: Whether its reset rebuilt the world, so that its states can be had again to the
            last bit; where worlds are reused, they also depend on the episodes before.
    """

    episode_id: int
    seed: int | None
    control_mode: str
    actions: NDArray[np.float32]
    states: States | None = None
    rewards: NDArray[np.float32] | None = None
    success: NDArray[np.bool_] | None = None
    terminated: NDArray[np.bool_] | None = None
    truncated: NDArray[np.bool_] | None = None
    rebuilt: bool = False

    @property
    def solved(self) -> bool | None:
        """Whether the last step ended in success; None if the file does not say."""
        return None if self.success is None else bool(self.success[-1])


class TrajectoryFile(Sequence[Trajectory]):
    """A file of recorded episodes, ours or native's; each is read when it is asked for.

    Attributes:
        path: The h5 file.
        task_id: Id of the task that was recorded.
        control_mode: Control mode of every episode.
        max_episode_steps: Control steps until an episode was truncated, or None.
        env_kwargs: What native's environment was made with.
        source_type: Where the actions come from, in ManiSkill's words, or None.
        layout: What `rollouts.provenance.describe_layout` wrote; None in native's files.
        simulation: What `rollouts.provenance.describe_simulation` wrote; None in native's files.
        action_split: Robot name → slice of the flat action; None in native's files.
        seeds: Reset seed of each episode, or None.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open a file; nothing of its episodes is read yet.

        Args:
            path: The h5 file; its json must lie beside it.

        Raises:
            TrajectoryError: If there is no such file, it or its json is of another kind or
                damaged, or its control mode is unknown.
        """
        self.path = Path(path)
        expect_file(self.path, (".h5",))
        summary = read_summary(self.path)
        info = summary["env_info"]
        self.task_id = str(info["env_id"])
        self.env_kwargs: dict[str, Any] = dict(info.get("env_kwargs") or {})
        self.max_episode_steps: int | None = info.get("max_episode_steps")
        self.source_type: str | None = summary.get("source_type")
        self._episodes: list[dict[str, Any]] = list(summary["episodes"])
        self.seeds = tuple(_seed(episode) for episode in self._episodes)
        self.control_mode = self._common_mode()
        with _damage(self.path, "this h5 file"):
            self._file = h5py.File(self.path, "r")
            about: list[dict[str, Any] | None] = [
                json.loads(self._file.attrs.get(name, "null")) for name in ("layout", "simulation")
            ]
        self.layout, self.simulation = about
        self.action_split = (
            {name: slice(*robot["action"]) for name, robot in self.layout.items()}
            if self.layout
            else None
        )

    def __enter__(self) -> TrajectoryFile:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        self._file.close()

    def __len__(self) -> int:
        """Return the number of episodes."""
        return len(self._episodes)

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trajectory]: ...

    def __getitem__(self, index: int | slice) -> Trajectory | list[Trajectory]:
        """Read an episode, or several.

        Raises:
            IndexError: If there is no such episode.
            TrajectoryError: If it is damaged or cannot be played.
        """
        if isinstance(index, slice):
            return [self._read(episode) for episode in self._episodes[index]]
        return self._read(self._episodes[index])

    def expect(self, task_id: str, action_dim: int) -> None:
        """Refuse a file of another task, or of robots that take other actions.

        Args:
            task_id: The task the episodes must be for.
            action_dim: Numbers of one action A.

        Raises:
            TrajectoryError: If something differs, or there are no episodes.
        """
        if self.task_id != task_id:
            raise TrajectoryError(f"{self.path} was recorded in {self.task_id}, not in {task_id}")
        if not self._episodes:
            raise TrajectoryError(f"{self.path} holds no episodes")
        for episode in self._episodes:
            shape = self._actions(episode).shape
            if shape[1] != action_dim:
                self._refuse(
                    episode,
                    f"its actions have shape {shape}, not (T, {action_dim}): the robots are others",
                )

    def expect_world(self, task: MultiRobotTask) -> None:
        """Refuse a task with another layout, robot files or physics than the recording had.

        Native's files do not say what they had; they pass.

        Raises:
            TrajectoryError: If something differs; names every difference, or the first few.
        """
        here = {"layout": describe_layout(task.layout), "simulation": describe_simulation(task)}
        recorded = {"layout": self.layout, "simulation": self.simulation}
        found = [
            difference
            for name, about in recorded.items()
            if about is not None
            for difference in differences(about, here[name])
        ]
        if found:
            raise TrajectoryError(
                f"{self.path} was recorded in another world than this {task.task_id}:"
                f" {listing(found)}"
            )

    def _common_mode(self) -> str:
        default = self.env_kwargs.get("control_mode")
        found = {mode for episode in self._episodes for mode in _modes(episode, default)}
        modes = sorted(found or _modes({}, default))
        if len(modes) == 1 and modes[0] in CONTROL_MODES:
            return modes[0]
        listing = " and ".join(modes) or "no control mode that it names"
        raise TrajectoryError(
            f"{self.path} was recorded in {listing}; an episode can be played in one of"
            f" {', '.join(CONTROL_MODES)}"
        )

    def _read(self, about: Mapping[str, Any]) -> Trajectory:
        group, actions = self._group(about), self._actions(about)
        with _damage(self.path, _name(about)):
            numbers: NDArray[Any] = actions[()]
            states = _read_states(group["env_states"]) if "env_states" in group else None
            columns = {name: group[name][()] for name in ("rewards", *_FLAGS) if name in group}
        if numbers.dtype.kind != "f" or not np.isfinite(numbers).all():
            self._refuse(about, "its actions are not all finite floating-point numbers")
        for name, column in columns.items():
            if column.shape != (len(numbers),):
                self._refuse(about, f"{name} has shape {column.shape}, not ({len(numbers)},)")
        for name, rows in _entries(states):
            if rows.ndim != 2 or len(rows) != len(numbers) + 1:
                wanted = f"({len(numbers) + 1}, k)"
                self._refuse(about, f"its states of {name} have shape {rows.shape}, not {wanted}")
        return Trajectory(
            episode_id=int(about["episode_id"]),
            seed=_seed(about),
            control_mode=self.control_mode,
            actions=numbers.astype(np.float32),
            states=states,
            rewards=_column(columns, "rewards", np.float32),
            **{flag: _column(columns, flag, np.bool_) for flag in _FLAGS},
            rebuilt=bool((_reset(about).get("options") or {}).get("reconfigure")),
        )

    def _group(self, about: Mapping[str, Any]) -> Any:
        name = _name(about)
        with _damage(self.path, name):
            group: Any = self._file.get(name)
            own: Any = json.loads(getattr(group, "attrs", {}).get("episode", "null"))
        if not isinstance(group, h5py.Group):
            self._refuse(about, "the json beside it lists it, but it is not in the file")
        if own is not None and own["episode_seed"] != about.get("episode_seed"):
            self._refuse(
                about,
                f"the json beside it says seed {about.get('episode_seed')}, the file"
                f" {own['episode_seed']}: the recording was killed as it ended; resume it once",
            )
        return group

    def _actions(self, about: Mapping[str, Any]) -> h5py.Dataset:
        with _damage(self.path, _name(about)):
            actions: Any = self._group(about).get("actions")
        if isinstance(actions, h5py.Group):
            self._refuse(
                about,
                f"its actions are by robot ({', '.join(actions)}), not one flat array",
            )
        if not isinstance(actions, h5py.Dataset):
            self._refuse(about, "it has no actions")
        if actions.ndim != 2 or not len(actions):
            self._refuse(about, f"its actions have shape {actions.shape}, not (T, A)")
        return actions

    def _refuse(self, about: Mapping[str, Any], why: str) -> NoReturn:
        raise TrajectoryError(f"{_name(about)} of {self.path} cannot be played: {why}")


def read_summary(path: Path) -> Mapping[str, Any]:
    """Return the json beside an h5 file; it has ``env_info`` with ``env_id``, and ``episodes``.

    Raises:
        TrajectoryError: If it cannot be read, or is of another kind.
    """
    beside = path.with_suffix(".json")
    try:
        found: Any = json.loads(beside.read_text())
        missing = {"env_info", "episodes"} - set(found) or {"env_id"} - set(found["env_info"])
        listed: list[Any] = [] if missing else [_name(episode) for episode in found["episodes"]]
    except OSError as error:
        raise TrajectoryError(
            f"cannot read {beside}, which belongs beside {path.name}: {error.strerror}"
        ) from error
    except (ValueError, TypeError, KeyError) as error:
        raise TrajectoryError(f"{beside} is not a demonstration's json: {error!r}") from error
    if missing:
        raise TrajectoryError(
            f"{beside} is not a demonstration's json: it has no {', '.join(sorted(missing))}"
        )
    if len(set(listed)) != len(listed):
        raise TrajectoryError(f"{beside} lists an episode twice")
    return found


def recorded_task(path: Path) -> str:
    """Return the id of the task that a file was recorded in, from the json beside it.

    Raises:
        TrajectoryError: If the json cannot be read.
    """
    return str(read_summary(path)["env_info"]["env_id"])


def expect_file(path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a path that is no file, or ends with none of ``suffixes``.

    Raises:
        TrajectoryError: If so; names the file in the folder that is most like it.
    """
    if not path.is_file():
        siblings = (p.name for p in path.parent.glob("*") if p.suffix in suffixes)
        match = closest_match(path.name, siblings)
        hint = f"; did you mean {path.parent / match}?" if match else ""
        raise TrajectoryError(f"there is no file {path}{hint}")
    if path.suffix not in suffixes:
        raise TrajectoryError(
            f"{path} is of an unknown kind {path.suffix!r}; known are {', '.join(suffixes)}"
        )


def _name(about: Mapping[str, Any]) -> str:
    return f"traj_{about['episode_id']}"


def _reset(about: Mapping[str, Any]) -> Mapping[str, Any]:
    return about.get("reset_kwargs") or {}


def _seed(about: Mapping[str, Any]) -> int | None:
    seed = _reset(about).get("seed")
    if isinstance(seed, list) and len(seed) == 1:
        seed = seed[0]
    return seed if isinstance(seed, int) else None


def _modes(about: Mapping[str, Any], default: Any) -> set[str]:
    mode = about.get("control_mode", default)
    if mode is None:
        return set()
    return {str(m) for m in mode.values()} if isinstance(mode, dict) else {str(mode)}


def _read_states(group: Any) -> States:
    return {
        kind: {name: np.asarray(rows[()], np.float32) for name, rows in entries.items()}
        for kind, entries in group.items()
    }


def _entries(states: States | None) -> list[tuple[str, NDArray[np.float32]]]:
    return [entry for entries in (states or {}).values() for entry in entries.items()]


def _column(
    columns: Mapping[str, NDArray[Any]], name: str, kind: type[Number]
) -> NDArray[Number] | None:
    return columns[name].astype(kind) if name in columns else None


@contextmanager
def _damage(path: Path, what: str) -> Generator[None]:
    """Turn what h5py says about damaged or foreign files, in several ways, into our error."""
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        if isinstance(error, RobotLayoutsError):
            raise
        raise TrajectoryError(
            f"{path} holds no readable episodes: {what} is of another kind, truncated or"
            f" damaged ({error})"
        ) from error
