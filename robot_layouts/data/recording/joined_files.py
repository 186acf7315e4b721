"""The h5 files that the episodes of a recording are joined into, and their manifest.

They are in ManiSkill's own trajectory format.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import h5py
from numpy.typing import NDArray

from robot_layouts.core.files import open_regular, parse_json, read_text
from robot_layouts.core.schema import FieldError
from robot_layouts.core.writing import write_whole, written_whole
from robot_layouts.data.reading.damage import damage_errors
from robot_layouts.data.reading.hdf5 import Hdf5File
from robot_layouts.data.reading.manifest import (
    FILE_NUMBER,
    FileEntry,
    Manifest,
    file_path,
    manifest_path,
    manifest_text,
    read_manifest,
    sized_file,
    spans_of,
)
from robot_layouts.data.reading.provenance import (
    CHECKSUM,
    checksum,
    header_differences,
    header_hash,
    listing,
    numbered,
    read_described,
)
from robot_layouts.data.reading.summary import MAX_JSON, OwnEpisode, TrajectoryError
from robot_layouts.data.recording.disk import DiskFile, disk_errors
from robot_layouts.data.recording.episode_files import Stored, read_part
from robot_layouts.data.sources.actors import Source, combined, source_of
from robots import RecordingError, UnreadableFileError

# From HDF5 1.8, the first in which attributes may be larger than 64 kB.
_VERSIONS = "v108", "latest"
_GROUP = re.compile("traj_[0-9]+")
_TEXT = h5py.string_dtype()
_HDF5: Any = h5py  # whose low-level modules pyright cannot look into


class Held(NamedTuple):
    """An episode that is in an h5 file.

    Attributes:
        group: Its group there.
        about: Its json.
        size: Its `Stored.size`.
    """

    group: str
    about: dict[str, Any]
    size: int


@dataclass
class OpenFile:
    """A file of a recording that may have to be written anew.

    Attributes:
        number: Which file; see `robot_layouts.data.reading.manifest.file_path`.
        episodes: Its episodes by seed, ascending.
        sources: What its header says of its source, unless it is empty.
        lost: Seeds of episodes that it held, and that are damaged.
        whole: Whether there is nothing to mend in the h5 file.
    """

    number: int
    episodes: dict[int, Held] = field(default_factory=dict[int, Held])
    sources: frozenset[Source] = frozenset()
    lost: frozenset[int] = frozenset()
    whole: bool = False


class JoinedFiles:
    """The files of a recording: full ones, which stay as they are, and a last one that may grow.

    Full files that are as the manifest says are not read again.

    Attributes:
        manifest: Where the manifest is.
        paths: The h5 files that are there, or that the manifest lists, the first one first.
        last: The last file.
        mending: Full files of which episodes are damaged, by number.
        seeds: Seeds of the episodes of all files.
        damaged: What is damaged, in words.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        """Find the files.

        Args:
            path: The first h5 file of a recording.
            header: What its episodes have in common.

        Raises:
            RecordingError: If another recording has the name of one.
        """
        self._path, self._header, self.manifest = path, header, manifest_path(path)
        self._entries: list[FileEntry] = []  # of the full files
        self._last_entry: FileEntry | None = None
        self.last = OpenFile(0)
        self.mending: dict[int, OpenFile] = {}
        self.seeds = set[int]()
        self.damaged: list[str] = []
        self._listed = self._read_manifest()
        self.paths = self._find()

    def read(self) -> None:
        """Check what is there; files that a kill left half noted are noted.

        Raises:
            RecordingError: If it is of something else, or no recording.
        """
        for number, path in enumerate(self.paths):
            entry = self._listed[number] if number < len(self._listed) else None
            if number + 1 == len(self.paths):
                self.last = self._read_all(number, path, entry)
            elif entry is not None and entry.matches(path):
                self._entries.append(entry)
                self._note_seeds(path, entry.seeds)
            else:
                self._reopen(number, path, entry)
        if self._entries:
            self._expect_same(self.paths[0], read_header(self.paths[0]))

    def remove(self) -> None:
        """Delete all files."""
        for path in (self.manifest, *self.paths, self._path):
            path.with_suffix(".json").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        self._listed, self.paths = (), []

    def write(
        self,
        file: OpenFile,
        places: Mapping[int, Path | str],
        sources: Iterable[Source] = (),
        *,
        last: bool,
    ) -> None:
        """Write a file; the manifest must be written after it.

        Args:
            file: What is there.
            places: Where its episodes are, by seed, ascending: parts, or groups of what is there.
            sources: What parts say of their source.
            last: Whether it may grow; else the next file becomes the last.

        Raises:
            RecordingError: If it cannot be written, or an episode not be read.
        """
        path, kept = file_path(self._path, file.number), file.episodes.keys() & places.keys()
        file.sources = frozenset(sources) | (file.sources if kept else frozenset())
        about = combined(file.sources or [source_of(self._header)])
        header = numbered({**self._header, **about}, file.number)
        if not file.whole or [*places.values()] != [held.group for held in file.episodes.values()]:
            file.episodes = join(path, header, places)
            file.whole, file.lost = True, frozenset()
        abouts = [held.about for held in file.episodes.values()]
        episodes = [{"episode_id": number, **about} for number, about in enumerate(abouts)]
        text = json.dumps({**header, "episodes": episodes}, indent=1) + "\n"
        _write_if_other(path.with_suffix(".json"), text)
        self.seeds.update(places)
        entry = FileEntry(
            sized_file(path),
            sized_file(path.with_suffix(".json")),
            len(abouts),
            sum(bool(about["success"]) for about in abouts),
            sum(about["elapsed_steps"] for about in abouts),
            spans_of(file.episodes),
        )
        if last:
            self._last_entry = entry if file.number else None
            return
        self._entries[file.number : file.number + 1] = [entry]
        if file is self.last:
            self.last = OpenFile(file.number + 1)

    def write_manifest(self) -> None:
        """Write which files there are; none if there is one alone.

        Raises:
            RecordingError: If it cannot be written.
        """
        if not self._entries:
            self.manifest.unlink(missing_ok=True)
            return
        entries = (*self._entries, *([self._last_entry] if self._last_entry else []))
        task_id = self._header["env_info"]["env_id"]
        manifest = Manifest(task_id, header_hash(self._header), entries)
        _write_if_other(self.manifest, manifest_text(manifest, self._path))

    def write_empty(self) -> None:
        """Write the last file without episodes; none if there are others.

        Raises:
            RecordingError: If it cannot be written.
        """
        if not self.last.number:
            self.write(self.last, {}, last=True)
        else:
            path = file_path(self._path, self.last.number)
            path.with_suffix(".json").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        self.write_manifest()

    def read_groups(self, file: OpenFile, seeds: Iterable[int]) -> Iterator[tuple[int, Stored]]:
        """Yield episodes of one of the files with their seeds.

        Raises:
            RecordingError: If one is damaged.
        """
        path = file_path(self._path, file.number)
        with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as opened:
            for seed in seeds:
                yield seed, _read_episode(opened, file.episodes[seed].group)

    def _read_manifest(self) -> tuple[FileEntry, ...]:
        try:
            manifest = read_manifest(self._path)
        except TrajectoryError:  # the files are read in its place, and it is written anew
            return ()
        if manifest is None or manifest.header != header_hash(self._header):
            return ()
        return manifest.files

    def _find(self) -> list[Path]:
        for path in (self._path, self._path.with_suffix(".json")):
            _expect_file_or_nothing(path)
        count = int(self._path.exists())
        while (path := file_path(self._path, number := max(count, 1))).exists():
            _expect_file_or_nothing(path)
            if number >= len(self._listed) and read_header(path).get(FILE_NUMBER) != number:
                raise RecordingError(
                    f"{path} is a recording of its own, in the place of a later file of"
                    f" {self._path}; choose another name"
                )
            count = number + 1
        return [file_path(self._path, i) for i in range(max(count, len(self._listed)))]

    def _read_all(self, number: int, path: Path, entry: FileEntry | None) -> OpenFile:
        """Read all of a file."""
        listed = frozenset(entry.seeds if entry else ())
        if not path.exists():
            self.damaged.append(f"{path} with its {len(listed)} episodes, which is gone,")
            return OpenFile(number, lost=listed)
        header, episodes, damaged = read_joined(path)
        self._expect_same(path, header)
        self.damaged += [f"{name} of {path}" for name in damaged]
        self._note_seeds(path, episodes)
        in_order = [held.group for held in episodes.values()] == [
            f"traj_{i}" for i in range(len(episodes))
        ]
        return OpenFile(
            number,
            episodes,
            frozenset([source_of(header)] if episodes else ()),
            listed - set(episodes),
            in_order and not damaged,
        )

    def _reopen(self, number: int, path: Path, entry: FileEntry | None) -> None:
        """Mend a full file that is not as the manifest says, or leave that until the end."""
        if entry is None and not path.exists():
            raise RecordingError(
                f"{path} is gone, and nothing says what it held; bring it back, or choose another"
                " folder"
            )
        file = self._read_all(number, path, entry)
        if entry is not None and file.lost:
            self.mending[number] = file
            self._entries.append(entry)
        else:
            self.write(file, {s: held.group for s, held in file.episodes.items()}, last=False)

    def _note_seeds(self, path: Path, seeds: Iterable[int]) -> None:
        before, seeds = len(self.seeds), list(seeds)
        self.seeds.update(seeds)
        if len(self.seeds) != before + len(seeds):
            raise RecordingError(f"{path} holds an episode of a seed that a file before it holds")

    def _expect_same(self, path: Path, header: Mapping[str, Any]) -> None:
        if found := header_differences(header, self._header):
            raise RecordingError(
                f"{path} was recorded with something else, so this recording cannot go on there"
                f" ({listing(found)}); choose another folder"
            )


def read_joined(path: Path) -> tuple[dict[str, Any], dict[int, Held], list[str]]:
    """Read a recording that was written here; every episode's checksum is compared.

    Returns:
        What its episodes have in common; the episodes by seed, ascending; and the groups of those
        that are damaged.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    episodes: dict[int, Held] = {}
    damaged: list[str] = []
    with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as file:
        header = _header(file)
        for name in file.members():
            if not _GROUP.fullmatch(name):
                raise FieldError(f"{name} is no episode")
            try:
                with damage_errors(RecordingError):
                    stored = _read_episode(file, name)
            except RecordingError:
                damaged.append(name)
                continue
            if (seed := stored.about["episode_seed"]) in episodes:
                raise FieldError("it holds two episodes of one seed")
            episodes[seed] = Held(name, stored.about, stored.size)
    return header, dict(sorted(episodes.items())), damaged


def read_header(path: Path) -> dict[str, Any]:
    """Return what the episodes of a recording have in common.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as file:
        return _header(file)


def join(
    path: Path, header: Mapping[str, Any], places: Mapping[int, Path | str]
) -> dict[int, Held]:
    """Write episodes into one h5 file, numbered in the order given, in place of what is there.

    The bytes of the file depend on its episodes only, not on whether they come from parts or from
    another file: names are written in sorted order, and nothing has a time stamp.

    Args:
        path: The file; it is replaced in one step, when the new one is complete and on the disk.
        header: What the episodes have in common.
        places: What to join, by seed: parts, and names of groups in the present file.

    Raises:
        RecordingError: If it cannot be written, or an episode not be read; nothing is changed.
    """
    episodes: dict[int, Held] = {}
    with ExitStack() as stack:
        stack.enter_context(disk_errors(path))
        partial = stack.enter_context(written_whole(path, RecordingError, parents=False, sync=True))
        disk = stack.enter_context(DiskFile(partial, "w+"))
        stack.enter_context(disk.refusals())
        file = stack.enter_context(h5py.File(disk, "w", libver=_VERSIONS))
        present = stack.enter_context(Hdf5File(path)) if path.exists() else None
        for name, value in header.items():
            file.attrs[name] = json.dumps(value)
        for number, (seed, place) in enumerate(places.items()):
            if isinstance(place, Path):
                stored = read_part(place)[1]
            else:
                assert present is not None  # its groups were listed
                stored = _read_episode(present, place)
            _write_episode(file, f"traj_{number}", stored)
            episodes[seed] = Held(f"traj_{number}", stored.about, stored.size)
    return episodes


def _write_episode(file: h5py.File, name: str, stored: Stored) -> None:
    groups = {"": _new_group(file, name)}
    own = {CHECKSUM: checksum(stored.attributes, stored.arrays)}
    for key, text in sorted({**stored.attributes, **own}.items()):
        groups[""].attrs.create(key, text, dtype=_TEXT)
    for key, rows in sorted(stored.arrays.items()):
        above = ""
        *path, last = key.split("/")
        for part in path:
            inside = f"{above}/{part}"
            if inside not in groups:
                groups[inside] = _new_group(groups[above], part)
            above = inside
        _write_array(groups[above], last, rows)


def _write_array(group: h5py.Group, name: str, rows: NDArray[Any]) -> None:
    """Write what `create_dataset` would, at a third of its cost."""
    kind, space = _HDF5.h5t.py_create(rows.dtype, logical=True), _HDF5.h5s.create_simple(rows.shape)
    properties = _HDF5.h5p.create(_HDF5.h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    properties.set_fill_time(_HDF5.h5d.FILL_TIME_IFSET)
    dataset = _HDF5.h5d.create(group.id, name.encode(), kind, space, properties)
    dataset.write(_HDF5.h5s.ALL, _HDF5.h5s.ALL, rows, kind)


def _new_group(above: h5py.Group, name: str) -> h5py.Group:
    """Make a group without a time stamp, which `create_group` of older h5py writes."""
    properties = _HDF5.h5p.create(_HDF5.h5p.GROUP_CREATE)
    properties.set_obj_track_times(False)
    return h5py.Group(_HDF5.h5g.create(above.id, name.encode(), None, properties))


def _header(file: Hdf5File) -> dict[str, Any]:
    header = {name: parse_json(text) for name, text in (file.texts() or {}).items()}
    if "env_info" not in header:
        raise FieldError("it does not say what was recorded")
    return header


def _read_episode(file: Hdf5File, name: str) -> Stored:
    """Read an episode that was written here.

    Raises:
        ValueError: If its checksum is another, or it is none.
    """
    attributes, arrays = file.texts(name) or {}, file.numbers(name)
    own = attributes.pop(CHECKSUM, None)  # an earlier version wrote none
    if own not in (None, checksum(attributes, arrays)):
        raise FieldError(f"the checksum of {name} is another")
    if read_described(attributes, "episode", OwnEpisode) is None:
        raise FieldError(f"{name} has no attribute 'episode'")
    return Stored(attributes, arrays)


def _refusal(path: Path, reason: str) -> RecordingError:
    return RecordingError(f"{path} is no recording of this library, or it is damaged: {reason}")


def _write_if_other(path: Path, text: str) -> None:
    with suppress(UnreadableFileError):
        if read_text(path, MAX_JSON) == text:
            return
    write_whole(path, text, RecordingError, parents=False)


def _expect_file_or_nothing(path: Path) -> None:
    """Refuse a path at which there is something that is no file, before anything is recorded."""
    if os.path.lexists(path) and path.exists():
        try:
            open_regular(path).close()
        except UnreadableFileError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from error
