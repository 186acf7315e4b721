"""Reads recorded episodes: ManiSkill's trajectory format, h5 with a json beside it."""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from itertools import accumulate
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.files import open_regular
from robot_layouts.data.reading.hdf5 import Hdf5File, Shapes, damage_errors
from robot_layouts.data.reading.hub import local_place
from robot_layouts.data.reading.json_files import (
    FILE,
    MAX_STEPS,
    SUFFIX,
    EpisodeEntry,
    OwnEpisode,
    TrajectoryError,
    file_path,
    manifest_path,
    read_manifest,
    read_summary,
    seeds_of,
)
from robot_layouts.data.reading.provenance import (
    ARRAYS,
    CHECKSUM,
    GUESSED,
    LAYOUT,
    OBSERVATIONS,
    OBSERVED,
    ORDER,
    PICTURES,
    SIMULATION,
    STATES,
    TEXTS,
    action_split,
    checksum,
    describe_layout,
    describe_simulation,
    differences,
    in_order,
    listing,
    observed_checksum,
    read_described,
    recorded_simulator,
)
from robots import UnreadableFileError, closest_match
from tasks import TaskEnv
from tasks.arrays import nested
from tasks.episode import States
from tasks.native.controllers import CONTROLLER

_FLAGS = ("success", "terminated", "truncated")
_COLUMNS = ("rewards", *_FLAGS, "actor")

Number = TypeVar("Number", np.float32, np.bool_, np.uint8)


@dataclass(frozen=True)
class Trajectory:
    """One recorded episode of T steps.

    Attributes:
        episode_id: Its number in the file.
        seed: Seed of its reset; None if the file names none, or several.
        control_mode: See `robot_layouts.data.reading.json_files.RecordingSummary`.
        actions: Flat actions, (T, A).
        states: State dict of `TaskEnv.get_state_dict`, each entry (T + 1, k), the first
            row being the state after the reset; None if the file holds none.
        rewards: Shape (T,), or None if the file holds none.
        success: Shape (T,), or None.
        terminated: Shape (T,), or None.
        truncated: Shape (T,), or None.
        rebuilt: Whether its reset rebuilt the world, so that its states can be reached again to the
            last bit; where worlds are reused, they also depend on the episodes before.
        source: Who acted; None if the file does not say.
        drawn: What was varied in its world, by axis; None if nothing was.
        actor: Who acted at each step where several did, (T,) uint8: the number of one of the
            ``"actors"`` of ``source``; else None.
        corrections: What a corrector would have done at each step, (T, A), or None.
        reason: Why it failed, in words; empty if it did not, or if the file does not say.
    """

    episode_id: int
    seed: int | None
    control_mode: str | dict[str, str]
    actions: NDArray[np.float32]
    states: States | None = None
    rewards: NDArray[np.float32] | None = None
    success: NDArray[np.bool_] | None = None
    terminated: NDArray[np.bool_] | None = None
    truncated: NDArray[np.bool_] | None = None
    rebuilt: bool = False
    source: Mapping[str, Any] | None = None
    drawn: Mapping[str, Any] | None = None
    actor: NDArray[np.uint8] | None = None
    corrections: NDArray[np.float32] | None = None
    reason: str = ""

    @property
    def solved(self) -> bool | None:
        """Whether the last step ended in success; None if the file does not say."""
        return None if self.success is None else bool(self.success[-1])


class Recording(Sequence[Trajectory]):
    """Recorded episodes, ours or native's; each is read when it is asked for.

    A recording may have several files, of which two are open at most. What it says of all episodes
    is read from the first, and the others must agree.

    Attributes:
        path: The h5 file, or the first one.
        opened: What it was opened by.
        manifest: What its files are; None if one file is read alone.
        task_id: Id of the task that was recorded.
        module: Module of a user's own that registers the task; None if every process knows it.
        control_mode: Control mode of every episode.
        max_episode_steps: Control steps until an episode was truncated, or None.
        env_kwargs: What native's environment was made with.
        source_type: Where the actions come from, in ManiSkill's words, or None.
        layout: What `describe_layout` wrote; None in native's files.
        guessed: What `robot_layouts.data.reading.provenance.describe_guessed` wrote, or None.
        simulation: What `describe_simulation` wrote; None in native's
            files.
        pictures: What `robot_layouts.data.reading.provenance.describe_pictures` wrote, or None.
        action_split: Robot name → slice of the flat action; None in native's files.
        seeds: Reset seed of each episode, or None.
        sources: Who acted in each episode of the first file, or None; see `Trajectory`.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open a recording; nothing of its episodes is read yet.

        Args:
            path: One h5 file, beside which its json must lie; or all that belong together, by their
                folder, where the first is ``trajectory.h5``, or by their manifest; or
                ``hub:OWNER/NAME[@REVISION]``, a recording on the Hugging Face Hub.

        Raises:
            HubError: If it cannot be read from the Hub.
            TrajectoryError: If there is no such file, it or its json is of another kind or
                damaged, its control mode is unknown, or it is not what the manifest lists.
        """
        self.opened = local_place(path)
        self.path = first_file(self.opened)
        self.manifest = None if self.path == self.opened else read_manifest(self.path)
        if self.manifest is not None and not self.manifest.files:
            raise TrajectoryError(f"{manifest_path(self.path)} lists no files")
        self._first = first = _File(self.path)
        self._other: tuple[int, _File] | None = None  # its number, and the file
        self._action_dim: int | None = None
        self.task_id, self.module = first.summary.task_id, first.summary.module
        self.control_mode, self.env_kwargs = first.summary.control_mode, first.summary.env_kwargs
        self.max_episode_steps = first.summary.max_episode_steps
        self.source_type = first.summary.source_type
        self.layout, self.simulation = first.common["layout"], first.common["simulation"]
        self.guessed, self.pictures = first.common["guessed"], first.common["pictures"]
        self.action_split = first.action_split
        self.sources = tuple(entry.source for entry in first.entries)
        self.seeds, counts = first.seeds, [len(first.entries)]
        if self.manifest is not None:
            self._expect_listed(0, first)
            self.seeds = tuple(seed for file in self.manifest.files for seed in seeds_of(file))
            counts = [file["episodes"] for file in self.manifest.files]
        self._starts = [0, *accumulate(counts)]

    def __enter__(self) -> Recording:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close all files."""
        self.close()

    def close(self) -> None:
        """Close all files; closing twice is allowed."""
        self._first.hdf5.close()
        if self._other is not None:
            self._other[1].hdf5.close()

    def __len__(self) -> int:
        """Return the number of episodes of all files."""
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trajectory]: ...

    def __getitem__(self, index: int | slice) -> Trajectory | list[Trajectory]:
        """Read an episode, or several.

        Raises:
            IndexError: If there is no such episode.
            TrajectoryError: If it is damaged or cannot be played, or its file does not belong to
                the others.
        """
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(len(self)))]
        file, entry = self._place(index)
        found = file.read(entry)
        numbers = found.actions.shape[1]
        if file is not self._first and numbers != (self._action_dim or numbers):
            file.refuse(
                entry, f"its actions have shape {found.actions.shape}, not (T, {self._action_dim})"
            )
        if self.manifest is None:
            return found
        return replace(found, episode_id=range(len(self))[index])

    def observations(self, index: int) -> Any:
        """Return what was observed in an episode, as the file holds it; None if it holds nothing.

        Returns:
            (T + 1, …), the first row being of the reset, or nested dicts of such arrays.

        Raises:
            IndexError: If there is no such episode.
            TrajectoryError: If it is damaged.
        """
        file, entry = self._place(index)
        return file.observations(entry)

    @property
    def corrected(self) -> bool:
        """Whether there are episodes, and all hold what a corrector would have done.

        Raises:
            TrajectoryError: If the file is damaged.
        """
        if not all(source and "corrects" in source for source in self.sources):
            return False
        name, first = "corrections", self._first
        return bool(self) and all(name in first.shapes(e, (name,)) for e in first.entries)

    def expect(self, task_id: str, action_dim: int) -> None:
        """Refuse episodes of another task, or of robots that take other actions.

        Files after the first are checked when they are read.

        Args:
            task_id: The task the episodes must be for.
            action_dim: Numbers of one action A.

        Raises:
            TrajectoryError: If something differs, or there are no episodes.
        """
        if self.task_id != task_id:
            raise TrajectoryError(f"{self.path} was recorded in {self.task_id}, not in {task_id}")
        if not self._first.entries:
            raise TrajectoryError(f"{self.path} holds no episodes")
        for entry in self._first.entries:
            self._first.texts(entry)
            shape = self._first.action_shape(entry, self._first.shapes(entry, ("actions",)))
            if shape[1] != action_dim:
                self._first.refuse(
                    entry,
                    f"its actions have shape {shape}, not (T, {action_dim}): the robots are others",
                )
        self._action_dim = action_dim

    @property
    def simulator(self) -> str:
        """What simulated its worlds."""
        return recorded_simulator(self.simulation)

    def expect_world(self, task: TaskEnv) -> None:
        """Refuse a task with another layout, robot files or physics than the recording had.

        Native's files do not say what they had; they pass, and so does another simulator, which
        has to be asked for.

        Raises:
            TrajectoryError: If something differs; names every difference, or the first few.
        """
        here = {"layout": describe_layout(task.layout), "simulation": describe_simulation(task)}
        recorded = {"layout": self.layout, "simulation": self.simulation}
        found = [
            difference
            for name, about in recorded.items()
            if about is not None
            for difference in differences(_without_engine(about), _without_engine(here[name]))
        ]
        if found:
            raise TrajectoryError(
                f"{self.path} was recorded in another world than this {task.task_id}:"
                f" {listing(found)}"
            )

    def _place(self, index: int) -> tuple[_File, EpisodeEntry]:
        """Return the file that an episode is in, and its entry there."""
        place = range(len(self))[index]
        number = bisect_right(self._starts, place) - 1
        file = self._file(number)
        return file, file.entries[place - self._starts[number]]

    def _file(self, number: int) -> _File:
        """Return one of the files, opened.

        Raises:
            TrajectoryError: If it cannot be read, or is of something else.
        """
        if not number:
            return self._first
        if self._other is None or self._other[0] != number:
            if self._other is not None:
                self._other[1].hdf5.close()
            self._other = None
            file = _File(file_path(self.path, number))
            self._expect_listed(number, file)
            if file.common != self._first.common:
                file.hdf5.close()
                names = [n for n, v in file.common.items() if v != self._first.common[n]]
                raise TrajectoryError(
                    f"{file.path} does not belong to {self.path}: its {' and '.join(names)}"
                    f" {'is' if len(names) == 1 else 'are'} another"
                )
            self._other = number, file
        return self._other[1]

    def _expect_listed(self, number: int, file: _File) -> None:
        """Refuse a file with other episodes than the manifest says."""
        assert self.manifest is not None  # one file alone has no others
        if list(file.seeds) != seeds_of(self.manifest.files[number]):
            file.hdf5.close()
            raise TrajectoryError(
                f"{file.path} does not hold the episodes that {manifest_path(self.path)} lists;"
                " if the recording was killed, resume it once"
            )


class _File:
    """One of a recording's h5 files, which is open, and the json beside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        expect_file(path, (".h5",))
        self.summary = read_summary(path)
        self.entries = self.summary.episodes
        self.seeds = tuple(entry.seed for entry in self.entries)
        with self._damage("this h5 file"):
            self.hdf5 = Hdf5File(path)
            names = ("layout", "simulation", "guessed", "pictures")
            described = self.hdf5.texts(names=names) or {}
            layout = read_described(described, "layout", LAYOUT)
            self.action_split = action_split(layout) if layout else None
            self.common: dict[str, Any] = {  # to all files of a recording
                "task_id": self.summary.task_id,
                "control_mode": self.summary.control_mode,
                "layout": layout,
                "simulation": read_described(described, "simulation", SIMULATION),
                "guessed": read_described(described, "guessed", GUESSED),
                "pictures": read_described(described, "pictures", PICTURES),
            }

    def read(self, entry: EpisodeEntry) -> Trajectory:
        texts = self.texts(entry)
        self._expect_shapes(entry, self.shapes(entry, ARRAYS))
        with self._damage(entry.group):
            arrays = self.hdf5.numbers(entry.group, ARRAYS)
        self._expect_numbers(entry, arrays)
        if texts.get(CHECKSUM) not in (None, checksum(texts, arrays)):
            self.refuse(
                entry,
                "it is damaged, or was changed after it was recorded: its checksum is another"
                f" (after a change on purpose, delete its attribute {CHECKSUM!r})",
            )
        return Trajectory(
            episode_id=entry.episode_id,
            seed=entry.seed,
            control_mode=self.summary.control_mode,
            actions=arrays["actions"].astype(np.float32),
            states=_states(arrays),
            rewards=_column(arrays, "rewards", np.float32),
            **{flag: _column(arrays, flag, np.bool_) for flag in _FLAGS},
            rebuilt=entry.rebuilt,
            source=entry.source,
            drawn=entry.drawn,
            actor=_column(arrays, "actor", np.uint8),
            corrections=_column(arrays, "corrections", np.float32),
            reason=entry.reason,
        )

    def observations(self, entry: EpisodeEntry) -> Any:
        """Return what was observed in an episode; see `Recording.observations`."""
        steps, _ = self.action_shape(entry, self.shapes(entry, ("actions",)))
        with self._damage(entry.group):
            texts = self.hdf5.texts(entry.group, (OBSERVED, ORDER)) or {}
            arrays = self.hdf5.numbers(entry.group, (OBSERVATIONS,), empty=True)
            arrays = in_order(arrays, texts)
        if texts.get(OBSERVED) not in (None, observed_checksum(arrays)):
            self.refuse(entry, "its observations are damaged: their checksum is another")
        for name, rows in arrays.items():
            if len(rows) != steps + 1 and not name.endswith("/"):  # which is an empty group
                self.refuse(entry, f"its {name} has shape {rows.shape}, not ({steps + 1}, …)")
        return nested(arrays).get(OBSERVATIONS)

    def texts(self, entry: EpisodeEntry) -> dict[str, str]:
        """Return the attributes of an episode that say what it is, if it has any."""
        with self._damage(entry.group):
            texts = self.hdf5.texts(entry.group, (*TEXTS, CHECKSUM))
            if texts is None:
                self.refuse(entry, "the json beside it lists it, but it is not in the file")
            own = read_described(texts, "episode", OwnEpisode)
        if own is not None and own["episode_seed"] != entry.episode_seed:
            self.refuse(
                entry,
                f"the json beside it says seed {entry.episode_seed}, the file"
                f" {own['episode_seed']}: the recording was killed as it ended; resume it once",
            )
        return texts

    def shapes(self, entry: EpisodeEntry, names: Collection[str]) -> Shapes:
        """Return the shapes of an episode's arrays, whose numbers are not read."""
        with self._damage(entry.group):
            return self.hdf5.shapes(entry.group, names)

    def action_shape(self, entry: EpisodeEntry, shapes: Shapes) -> tuple[int, int]:
        """Return (T, A), after a look whether T is what the json says."""
        shape = shapes.get("actions")
        if shape is None:
            robots = [name.partition("/")[2] for name in shapes if name.startswith("actions/")]
            by_robot = f"its actions are by robot ({', '.join(robots)}), not one flat array"
            self.refuse(entry, by_robot if robots else "it has no actions")
        if len(shape) != 2 or not shape[0]:
            self.refuse(entry, f"its actions have shape {shape}, not (T, A)")
        if shape[0] != (entry.steps or min(shape[0], MAX_STEPS)):
            self.refuse(
                entry,
                f"its actions have shape {shape}; the json beside it says"
                f" {entry.steps or f'nothing, and at most {MAX_STEPS}'} steps",
            )
        return shape

    def _expect_shapes(self, entry: EpisodeEntry, shapes: Shapes) -> None:
        steps, numbers = self.action_shape(entry, shapes)
        for name, shape in shapes.items():
            if name == "corrections" and shape != (steps, numbers):
                self.refuse(entry, f"{name} has shape {shape}, not ({steps}, {numbers})")
            if name in _COLUMNS and shape != (steps,):
                self.refuse(entry, f"{name} has shape {shape}, not ({steps},)")
            if not f"{name}/".startswith(STATES):
                continue
            kind = name.split("/")[1] if "/" in name else ""
            if name.count("/") != 2 and (kind != CONTROLLER or name.count("/") < 2):
                self.refuse(entry, f"its states are not by kind and name ({name})")
            if len(shape) != 2 or shape[0] != steps + 1:
                what = f"its states of {name.rpartition('/')[2]} have shape {shape}"
                self.refuse(entry, f"{what}, not ({steps + 1}, k)")

    def _expect_numbers(self, entry: EpisodeEntry, arrays: Mapping[str, NDArray[Any]]) -> None:
        if arrays["actions"].dtype.kind != "f" or not np.isfinite(arrays["actions"]).all():
            self.refuse(entry, "its actions are not all finite floating-point numbers")
        for name, rows in arrays.items():
            if not np.isfinite(rows).all():
                self.refuse(entry, f"its {name} are not all finite")
        actors = len((entry.source or {}).get("actors", ()))
        actor = arrays.get("actor")
        if actor is not None and (actor.dtype != np.uint8 or (actor >= actors).any()):
            self.refuse(entry, f"its actor is not at each step one of the {actors} of its source")

    def refuse(self, entry: EpisodeEntry, why: str) -> NoReturn:
        raise TrajectoryError(f"{entry.group} of {self.path} cannot be played: {why}")

    def _damage(self, what: str) -> AbstractContextManager[None]:
        return damage_errors(
            lambda reason: TrajectoryError(
                f"{self.path} holds no readable episodes: {what} is of another kind, truncated or"
                f" damaged ({reason})"
            )
        )


def _without_engine(described: Mapping[str, Any]) -> dict[str, Any]:
    engine = ("simulator", "simulator_version")
    return {name: about for name, about in described.items() if name not in engine}


def first_file(path: str | PathLike[str]) -> Path:
    """Return the h5 file, or the first one, of what `Recording` is given."""
    place = local_place(path)
    if place.is_dir():
        return place / FILE
    if place.name.endswith(SUFFIX):
        return place.with_name(f"{place.name.removesuffix(SUFFIX)}.h5")
    return place


def all_files(path: str | PathLike[str]) -> list[Path]:
    """Return all h5 files of what `Recording` is given.

    Raises:
        TrajectoryError: If it has a manifest that cannot be read.
    """
    place = local_place(path)
    first = first_file(place)
    manifest = None if first == place else read_manifest(first)
    return [file_path(first, i) for i in range(len(manifest.files) if manifest else 1)]


def expect_file(path: Path, suffixes: Sequence[str]) -> None:
    """Refuse a path that is no file, or ends with none of ``suffixes``.

    Raises:
        TrajectoryError: If so; names the file in the folder that is most like it.
    """
    if os.path.lexists(path) and not path.is_file():
        try:
            open_regular(path).close()
        except UnreadableFileError as error:
            raise TrajectoryError(str(error)) from error
    if not path.is_file():
        siblings = (p.name for p in path.parent.glob("*") if p.suffix in suffixes)
        match = closest_match(path.name, siblings)
        hint = f"; did you mean {path.parent / match}?" if match else ""
        raise TrajectoryError(f"there is no file or folder {path}{hint}")
    if path.suffix not in suffixes:
        raise TrajectoryError(
            f"{path} is of an unknown kind {path.suffix!r}; known are {', '.join(suffixes)}"
        )


def _states(arrays: Mapping[str, NDArray[Any]]) -> States | None:
    states: States = {}
    for name, rows in arrays.items():
        if name.startswith(STATES):
            _, kind, entry = name.split("/", 2)
            states.setdefault(kind, {})[entry] = np.asarray(rows, np.float32)
    return states or None


def _column(
    columns: Mapping[str, NDArray[Any]], name: str, kind: type[Number]
) -> NDArray[Number] | None:
    return columns[name].astype(kind) if name in columns else None
