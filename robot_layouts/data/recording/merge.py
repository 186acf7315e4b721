"""Merges recordings of the same task, robots and control mode into one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from robot_layouts.core.cli import Folder, Word
from robot_layouts.core.commands import printable
from robot_layouts.core.pages import plural
from robot_layouts.core.progress import Progress
from robot_layouts.core.writing import written_whole
from robot_layouts.data.actors import Source, source_of
from robot_layouts.data.playing.command_options import megabytes, stoppable
from robot_layouts.data.reading.hdf5 import Hdf5File, damage_errors
from robot_layouts.data.reading.json_files import FILE_NUMBER, FILE_SIZE
from robot_layouts.data.reading.provenance import header_differences, listing
from robot_layouts.data.reading.recording import FILE, all_files
from robot_layouts.data.recording.episode_files import (
    JoinedEpisode,
    Stored,
    damaged_recording,
    read_joined,
    read_joined_episode,
)
from robot_layouts.data.recording.recorder import JoinedFiles
from robots import RecordingError


class _Found(NamedTuple):
    """An episode of a recording.

    Attributes:
        recording: The number of the recording.
        path: The file that it is in.
        source: What that says of its source.
        held: What is known of it.
    """

    recording: int
    path: Path
    source: Source
    held: JoinedEpisode


def merge(
    recordings: Sequence[str | PathLike[str]],
    folder: str | PathLike[str],
    *,
    file_size: float = FILE_SIZE,
    watch: Callable[[int, int], None] = lambda done, episodes: None,
) -> int:
    """Write the episodes of several recordings into one, numbered in the order of their seeds.

    Args:
        recordings: Each an h5 file, or the folder of a recording.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written. It must be empty or not
            there; it appears when it is complete.
        file_size: Size at which a further h5 file is begun (MB).
        watch: Called with how many episodes are written, and how many there are.

    Returns:
        How many episodes were written.

    Raises:
        RecordingError: If the recordings are of different tasks, robots, modes or physics, hold
            episodes of one seed, are damaged or were not recorded by this library, or the folder
            cannot be written; nothing is written then.
        TrajectoryError: If one is not there.
    """
    target = Path(folder)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise RecordingError(f"{target} is there already; choose another folder")
    header, episodes = _read(recordings)
    with written_whole(target, RecordingError) as place, ExitStack() as stack:
        place.mkdir()
        read, left = _EpisodeReader(stack), sorted(episodes)
        files = JoinedFiles(place / FILE, header)
        while left:
            count = _fitting([episodes[seed].held.size for seed in left], file_size * 1e6)
            seeds, left = left[:count], left[count:]
            places = {seed: partial(read, episodes[seed]) for seed in seeds}
            sources = {episodes[seed].source for seed in seeds}
            files.write(files.last, places, sources, last=not left)
            watch(len(files.seeds), len(episodes))
        files.write_manifest()
    return len(episodes)


def _read(recordings: Sequence[str | PathLike[str]]) -> tuple[dict[str, Any], dict[int, _Found]]:
    """Return what recordings have in common, and their episodes by seed.

    Raises:
        RecordingError: If they do not go together.
    """
    if len(recordings) < 2:
        raise RecordingError("one recording is not merged; name two or more")
    common: dict[str, Any] = {}
    episodes: dict[int, _Found] = {}
    paths = [(i, path) for i, one in enumerate(recordings) for path in all_files(one)]
    first = paths[0][1]
    for number, path in paths:
        header, found, damaged = read_joined(path)
        common = common or {name: value for name, value in header.items() if name != FILE_NUMBER}
        if damaged:
            raise RecordingError(
                f"{damaged[0]} of {path} is damaged; the command that recorded it records it again"
            )
        if differing := header_differences(common, header, (f"{first} has", f"{path} has")):
            raise RecordingError(
                f"{path} was not recorded with the same as {first}: {listing(differing)}"
            )
        if twice := sorted(found.keys() & episodes):
            more = f" and of {len(twice) - 1} others" if len(twice) > 1 else ""
            raise RecordingError(
                f"{path} and {episodes[twice[0]].path} both hold an episode of seed {twice[0]}"
                f"{more}; a recording holds one of each seed"
            )
        source = source_of(header)
        episodes |= {seed: _Found(number, path, source, held) for seed, held in found.items()}
    if not episodes:
        raise RecordingError(f"{first} and the others hold no episodes")
    return common, episodes


def _fitting(sizes: Sequence[int], limit: float) -> int:
    """Return how many of the first episodes fit into a file; one at least."""
    total = 0
    for count, size in enumerate(sizes):
        total += size
        if count and total > limit:
            return count
    return len(sizes)


class _EpisodeReader:
    """Reads episodes; one file of each recording stays open."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack, self._opened = stack, dict[int, tuple[Path, Hdf5File]]()

    def __call__(self, found: _Found) -> Stored:
        with damage_errors(lambda reason: damaged_recording(found.path, reason)):
            path, file = self._opened.get(found.recording, (None, None))
            if file is None or path != found.path:
                if file is not None:
                    file.close()
                file = self._stack.enter_context(Hdf5File(found.path))
                self._opened[found.recording] = found.path, file
            return read_joined_episode(file, found.held.group)


def merge_command(
    recordings: Annotated[Sequence[Path], Word("FILE")],
    *,
    out: Folder,
    file_size: Annotated[float, Word("MB", megabytes)] = FILE_SIZE,
) -> None:
    """Merge recordings of the same task, robots and control mode into one.

    Episodes are numbered in the order of their seeds, and stay as they are; the recordings are left
    alone. Exit code: 0 if they were merged, 1 if not, 2 for bad usage, 130 if interrupted.

    Args:
        recordings: Two or more: h5 files, or folders of recordings, with all their files.
        out: Folder of trajectory.h5 and .json, which must not be there yet.
        file_size: Begin another file, trajectory_0001.h5 and so on, when one is so large.

    Raises:
        RobotLayoutsError: If they do not go together, or cannot be read or written.
    """
    line = Progress(unit="episodes")
    with stoppable(), line:
        count = merge(
            recordings,
            out,
            file_size=file_size,
            watch=lambda done, episodes: line.update(done, "merging", episodes),
        )
    print(printable(f"{out / FILE}: {plural(count, 'episode')} of {len(recordings)} recordings"))
