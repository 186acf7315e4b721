"""The h5 file that finished episodes are joined into, in ManiSkill's own trajectory format.

Groups and datasets are made by h5py's low-level interface, at a third of what its own
`create_dataset` costs, with the properties that `create_dataset` would give them.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from robots import RecordingError
from robots.common.files import parse_json
from robots.common.schema import FieldError
from robots.common.writing import written_whole
from rollouts.reading.damage import damage_errors
from rollouts.reading.episode_checksum import CHECKSUM, checksum
from rollouts.reading.hdf5_file import Hdf5File
from rollouts.reading.provenance import read_described
from rollouts.reading.summary import OwnEpisode
from rollouts.recording.disk import disk_errors
from rollouts.recording.episode_files import Stored, read_part

# From HDF5 1.8, the first in which attributes may be larger than 64 kB.
_VERSIONS = "v108", "latest"
_OVERHEAD = 16_384  # bytes of an episode besides its numbers: four times those of ten arrays
_GROUP = re.compile("traj_[0-9]+")
_TEXT = h5py.string_dtype()
_HDF5: Any = h5py  # whose low-level modules pyright cannot look into


@dataclass(frozen=True)
class Joined:
    """What is in a recording that was written here.

    Attributes:
        header: What its episodes have in common.
        episodes: Its episodes' json by group.
        sizes: Their `Stored.size`, likewise.
        damaged: The groups of episodes that are damaged.
    """

    header: dict[str, Any]
    episodes: dict[str, dict[str, Any]]
    sizes: dict[str, int]
    damaged: tuple[str, ...]


def read_joined(path: Path) -> Joined:
    """Return what is in a recording; every episode is read, and its checksum compared.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    episodes: dict[str, dict[str, Any]] = {}
    sizes: dict[str, int] = {}
    damaged: list[str] = []
    with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as file:
        header = _header(file)
        for name in file.members():
            if not _GROUP.fullmatch(name):
                raise FieldError(f"{name} is no episode")
            try:
                with damage_errors(RecordingError):
                    stored = _read_episode(file, name)
                    episodes[name], sizes[name] = stored.about, stored.size
            except RecordingError:
                damaged.append(name)
        seeds = [about["episode_seed"] for about in episodes.values()]
        if len(set(seeds)) != len(seeds):
            raise FieldError("it holds two episodes of one seed")
    return Joined(header, episodes, sizes, tuple(damaged))


def read_header(path: Path) -> dict[str, Any]:
    """Return what the episodes of a recording have in common.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as file:
        return _header(file)


def read_groups(path: Path, groups: Iterable[str]) -> Iterator[Stored]:
    """Yield episodes of a recording that was written here.

    Raises:
        RecordingError: If one is damaged.
    """
    with damage_errors(lambda reason: _refusal(path, reason)), Hdf5File(path) as file:
        for name in groups:
            yield _read_episode(file, name)


def join(
    path: Path, header: Mapping[str, Any], episodes: Sequence[Path | str]
) -> dict[str, dict[str, Any]]:
    """Write episodes into one h5 file, numbered in the order given, in place of what is there.

    Args:
        path: The file; it is replaced in one step, when the new one is complete and on the disk.
        header: What the episodes have in common.
        episodes: What to join: parts, and names of groups in the present file.

    Returns:
        The episodes' json by group.

    Raises:
        RecordingError: If it cannot be written, or an episode not be read; nothing is changed.
    """
    about: dict[str, dict[str, Any]] = {}
    with (
        disk_errors(path),
        written_whole(path, RecordingError, parents=False, sync=True) as partial,
    ):
        _reserve(partial, _room(path, episodes))
        with ExitStack() as stack:
            file = stack.enter_context(h5py.File(partial, "r+", libver=_VERSIONS))
            present = stack.enter_context(Hdf5File(path)) if path.exists() else None
            for name, value in header.items():
                file.attrs[name] = json.dumps(value)
            writer = _GroupWriter(file)
            for number, episode in enumerate(episodes):
                stored = _read(present, episode)
                writer.write(f"traj_{number}", stored)
                about[f"traj_{number}"] = stored.about
    return about


def _read(present: Hdf5File | None, episode: Path | str) -> Stored:
    if isinstance(episode, Path):
        return read_part(episode)[1]
    assert present is not None  # its groups were listed
    return _read_episode(present, episode)


def _room(path: Path, episodes: Sequence[Path | str]) -> int:
    """Return more bytes than the joined episodes take."""
    files = [path] if path.exists() else []
    files += [episode for episode in episodes if isinstance(episode, Path)]
    return sum(file.stat().st_size for file in files) + _OVERHEAD * (len(episodes) + 1)


def _reserve(path: Path, room: int) -> None:
    """Make an empty h5 file that has its room on the disk: HDF5 crashes on one that is full.

    HDF5 gives back what it does not use when it closes the file.
    """
    with h5py.File("new", "w", driver="core", backing_store=False, libver=_VERSIONS) as file:
        file.flush()
        path.write_bytes(file.id.get_file_image())
    with path.open("r+b") as stream:
        os.posix_fallocate(stream.fileno(), 0, room)


class _GroupWriter:
    """Writes episodes as groups of a file.

    Names are written in sorted order, and nothing has a time stamp: the bytes of a file depend on
    its episodes only, not on whether they come from parts or from another file.
    """

    def __init__(self, file: h5py.File) -> None:
        self._file = file.id
        self._group_properties = _HDF5.h5p.create(_HDF5.h5p.GROUP_CREATE)
        self._group_properties.set_obj_track_times(False)
        self._properties = _HDF5.h5p.create(_HDF5.h5p.DATASET_CREATE)
        self._properties.set_obj_track_times(False)
        self._properties.set_fill_time(_HDF5.h5d.FILL_TIME_IFSET)
        self._text = _HDF5.h5t.py_create(_TEXT, logical=True)
        self._one = _HDF5.h5s.create(_HDF5.h5s.SCALAR)
        self._types: dict[Any, Any] = {}
        self._spaces: dict[tuple[int, ...], Any] = {}

    def write(self, name: str, stored: Stored) -> None:
        groups = {"": self._create_group(self._file, name)}
        own = {CHECKSUM: checksum(stored.attributes, stored.arrays)}
        for key, text in sorted({**stored.attributes, **own}.items()):
            attribute = _HDF5.h5a.create(groups[""], key.encode(), self._text, self._one)
            attribute.write(np.array(text, _TEXT))
        for key, rows in sorted(stored.arrays.items()):
            above, _, last = key.rpartition("/")
            self._write_array(self._find_group(groups, above), last, rows)

    def _find_group(self, groups: dict[str, Any], name: str) -> Any:
        if name not in groups:
            above, _, last = name.rpartition("/")
            groups[name] = self._create_group(self._find_group(groups, above), last)
        return groups[name]

    def _create_group(self, above: Any, name: str) -> Any:
        return _HDF5.h5g.create(above, name.encode(), None, self._group_properties)

    def _write_array(self, group: Any, name: str, rows: NDArray[Any]) -> None:
        kind = self._types.get(rows.dtype)
        if kind is None:
            kind = self._types[rows.dtype] = _HDF5.h5t.py_create(rows.dtype, logical=True)
        space = self._spaces.get(rows.shape)
        if space is None:
            space = self._spaces[rows.shape] = _HDF5.h5s.create_simple(rows.shape)
        dataset = _HDF5.h5d.create(group, name.encode(), kind, space, self._properties)
        dataset.write(_HDF5.h5s.ALL, _HDF5.h5s.ALL, rows, kind)


def _header(file: Hdf5File) -> dict[str, Any]:
    header = {name: parse_json(text) for name, text in (file.texts() or {}).items()}
    if "env_info" not in header:
        raise FieldError("it does not say what was recorded")
    return header


def _read_episode(file: Hdf5File, name: str) -> Stored:
    """Read an episode that was written here.

    Raises:
        ValueError: If its checksum is another, or it is none; h5py raises other errors, too.
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
