"""Reads a recording that has several files as one sequence of episodes."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from os import PathLike
from pathlib import Path
from typing import overload

from rollouts.reading.manifest import (
    SUFFIX,
    Manifest,
    file_path,
    manifest_path,
    read_manifest,
)
from rollouts.reading.trajectory import Trajectory, TrajectoryError, TrajectoryFile

FILE = "trajectory.h5"

_ALIKE = ("task_id", "control_mode", "layout", "simulation", "guessed")


def open_trajectories(path: str | PathLike[str]) -> TrajectoryFile:
    """Open a recording.

    Args:
        path: One h5 file; or all that belong together, by their folder, where the first is
            ``trajectory.h5``, or by their manifest.

    Raises:
        TrajectoryError: If it cannot be read; see `TrajectoryFile`.
    """
    first = first_file(path)
    manifest = None if first == Path(path) else read_manifest(first)
    return TrajectoryFile(first) if manifest is None else Recording(first, manifest)


def first_file(path: str | PathLike[str]) -> Path:
    """Return the h5 file, or the first one, of what `open_trajectories` is given."""
    place = Path(path)
    if place.is_dir():
        return place / FILE
    if place.name.endswith(SUFFIX):
        return place.with_name(f"{place.name.removesuffix(SUFFIX)}.h5")
    return place


def all_files(path: str | PathLike[str]) -> list[Path]:
    """Return all h5 files of what `open_trajectories` is given.

    Raises:
        TrajectoryError: If it has a manifest that cannot be read.
    """
    first = first_file(path)
    manifest = None if first == Path(path) else read_manifest(first)
    return [file_path(first, i) for i in range(len(manifest.files) if manifest else 1)]


class Recording(TrajectoryFile):
    """All files of a recording as one; two of them are open at most.

    What it says of all episodes is read from the first file, and the others must agree. The
    ``episode_id`` of a trajectory is its place in the whole.

    Attributes:
        manifest: What the files are.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        """Open the first file.

        Args:
            path: The first h5 file.
            manifest: What lies beside it.

        Raises:
            TrajectoryError: If it cannot be read, or the manifest lists nothing.
        """
        if not manifest.files:
            raise TrajectoryError(f"{manifest_path(path)} lists no files")
        super().__init__(path)
        self.manifest = manifest
        self._starts = [0, *accumulate(entry.episodes for entry in manifest.files)]
        self._action_dim: int | None = None
        self._other: tuple[int, TrajectoryFile] | None = None  # its number, and the file
        self._expect_listed(0, self)
        self.seeds = tuple(seed for entry in manifest.files for seed in entry.seeds)

    def close(self) -> None:
        """Close all files; closing twice is allowed."""
        super().close()
        if self._other is not None:
            self._other[1].close()

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
        place = range(len(self))[index]
        number = bisect_right(self._starts, place) - 1
        inside = place - self._starts[number]
        found = self._file_of(number)[inside] if number else super().__getitem__(inside)
        shape = found.actions.shape
        if shape[1] != (self._action_dim or shape[1]):
            raise TrajectoryError(
                f"traj_{inside} of {file_path(self.path, number)} cannot be played: its actions"
                f" have shape {shape}, not (T, {self._action_dim})"
            )
        return replace(found, episode_id=place)

    def expect(self, task_id: str, action_dim: int) -> None:
        """See `TrajectoryFile.expect`; files after the first are looked at when they are read."""
        super().expect(task_id, action_dim)
        self._action_dim = action_dim

    def _file_of(self, number: int) -> Sequence[Trajectory]:
        if self._other is None or self._other[0] != number:
            if self._other is not None:
                self._other[1].close()
            self._other = None
            self._other = number, self._opened(number)
        return self._other[1]

    def _opened(self, number: int) -> TrajectoryFile:
        """Open a file after the first.

        Raises:
            TrajectoryError: If it cannot be read, or is of something else.
        """
        file = TrajectoryFile(file_path(self.path, number))
        try:
            self._expect_listed(number, file)
            if other := [name for name in _ALIKE if getattr(file, name) != getattr(self, name)]:
                raise TrajectoryError(
                    f"{file.path} does not belong to {self.path}: its {' and '.join(other)}"
                    f" {'is' if len(other) == 1 else 'are'} another"
                )
        except BaseException:
            file.close()
            raise
        return file

    def _expect_listed(self, number: int, file: TrajectoryFile) -> None:
        """Refuse a file with other episodes than the manifest says."""
        if list(file.seeds) != self.manifest.files[number].seeds:
            file.close()
            raise TrajectoryError(
                f"{file.path} does not hold the episodes that {manifest_path(self.path)} lists;"
                " if the recording was killed, resume it once"
            )
