"""Episodes as files: one in a part of its own when it is finished, then many in an h5 file.

A part is a line that says what it is, two lines of json, the bytes of its arrays, and a checksum of
all that. It is written while episodes are played, where an h5 file of as many arrays would cost
fifteen times as much. The h5 files are in ManiSkill's own trajectory format.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import h5py
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from typing_extensions import NotRequired, TypedDict

from robot_layouts.core.files import parse_json, read_regular
from robot_layouts.core.schema import AnyText, FieldError, Object, check, whole
from robot_layouts.core.writing import PARTIAL, DiskFile, disk_errors, written_whole
from robot_layouts.data.reading.hdf5 import MAX_BYTES, NOTHING, Hdf5File, damage_errors
from robot_layouts.data.reading.json_files import MAX_SEED, OwnEpisode
from robot_layouts.data.reading.provenance import (
    OBSERVATIONS,
    ORDER,
    STATES,
    checksums,
    in_order,
    read_described,
)
from robots import RecordingError
from tasks.arrays import leaves
from tasks.episode import REBUILT, PlayedEpisode

_SUFFIX = ".part"
_SEED = re.compile(r"seed-([0-9]{10,})")
_OPENING = b"robot-layouts episode 1\n"
_CHECKSUM = 4  # bytes
_ARRAY_BYTES, _GROUP_BYTES = 256, 1024  # that HDF5 takes besides numbers and texts, about
_MAX_PART = MAX_BYTES + 2**24  # bytes

_ARRAY_NAME = (
    r"^(actions|rewards|success|terminated|truncated|actor|corrections"
    r"|env_states(/[^/\0]+){2}|env_states/controller(/[^/\0]+){1,3}|obs(/[^/\0]+){0,5}/?)\Z"
)
# From HDF5 1.8, the first in which attributes may be larger than 64 kB.
_VERSIONS = "v108", "latest"
_GROUP = re.compile("traj_[0-9]+")
_PACKED = ("rgb", "depth", "seg")  # what ManiSkill's RecordEpisode packs by gzip
_TEXT = h5py.string_dtype()
_HDF5: Any = h5py  # whose low-level modules pyright cannot look into


class _Attributes(TypedDict):
    episode: AnyText
    order: NotRequired[AnyText]
    action_split: NotRequired[AnyText]


class _Content(TypedDict):
    attributes: _Attributes
    arrays: list[
        tuple[
            Annotated[str, Meta(pattern=_ARRAY_NAME, description="the name of an array")],
            Literal["<f4", "<f8", "|b1", "|u1", "<i2", "<i4", "<i8"],
            list[Annotated[int, whole(0, MAX_BYTES)]],
        ]
    ]


@dataclass(frozen=True)
class Stored:
    """What is stored of an episode.

    Attributes:
        attributes: Attributes of its group in the h5 file; ``episode`` is its entry in the json,
            without ``episode_id``.
        arrays: The arrays of that group by their names there, as ``env_states/actors/cube``; a name
            that ends with a slash is an empty group.

    The attributes do not include the checksum.
    """

    attributes: Mapping[str, str]
    arrays: Mapping[str, NDArray[Any]]

    @property
    def about(self) -> dict[str, Any]:
        """Its entry in the json, without ``episode_id``."""
        return json.loads(self.attributes["episode"])

    @property
    def size(self) -> int:
        """About how many bytes it takes in an h5 file; the same whatever file it is in."""
        numbers = sum(rows.nbytes for rows in self.arrays.values())
        return _size(self.attributes, len(self.arrays), numbers)


@dataclass(frozen=True)
class PartEncoder:
    """Encodes finished episodes; worker processes each have a copy.

    Attributes:
        header: What the episodes have in common; every part carries it.
        control_mode: Control mode as ManiSkill writes it: by robot where there are several.
    """

    header: Mapping[str, Any]
    control_mode: str | dict[str, str]
    _text: bytes = field(init=False, repr=False)
    _split: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Write as text once what all parts say."""
        split = {name: robot["action"] for name, robot in self.header["layout"].items()}
        object.__setattr__(self, "_text", json.dumps(self.header).encode())
        object.__setattr__(self, "_split", json.dumps(split))

    def encode(self, episode: PlayedEpisode) -> bytes:
        """Return the part of an episode.

        Raises:
            RecordingError: If it is too large to be read again.
        """
        arrays = _arrays(episode)
        attributes = {"action_split": self._split, "episode": json.dumps(self._about(episode))}
        if episode.observations is not None:
            attributes[ORDER] = json.dumps(list(arrays))
        if (size := sum(rows.nbytes for rows in arrays.values())) > MAX_BYTES:
            raise RecordingError(
                f"the episode of seed {episode.seed} has {size:,} bytes of observations and states,"
                f" of which {MAX_BYTES:,} can be stored; let cameras observe smaller pictures:"
                " camera_size=(128, 128), or --camera-size 128x128"
            )
        return self.encode_stored(Stored(attributes, arrays))

    def encode_stored(self, stored: Stored) -> bytes:
        """Return the part of an episode that was joined already."""
        arrays = stored.arrays
        about = {
            "attributes": dict(stored.attributes),
            "arrays": [(name, rows.dtype.str, rows.shape) for name, rows in arrays.items()],
        }
        numbers = [rows.tobytes() for rows in arrays.values()]
        content = b"".join(
            [_OPENING, self._text, b"\n", json.dumps(about).encode(), b"\n", *numbers]
        )
        return content + _checksum(content)

    def _about(self, episode: PlayedEpisode) -> dict[str, Any]:
        return {
            "episode_seed": episode.seed,
            "control_mode": self.control_mode,
            "elapsed_steps": len(episode.actions),
            "reset_kwargs": {"seed": episode.seed, "options": REBUILT},
            "success": episode.solved,
            **({"reason": episode.reason} if episode.reason else {}),
            **({"source": dict(episode.source)} if episode.source is not None else {}),
            **({"drawn": dict(episode.drawn)} if episode.drawn is not None else {}),
        }


def write_part(folder: Path, seed: int, part: bytes, *, sync: bool = False) -> None:
    """Write an encoded episode; it is there, whole, when this returns, or not at all.

    Args:
        folder: Where to write.
        seed: Its seed.
        part: What `PartEncoder.encode` returned, perhaps on another machine.
        sync: Whether to wait until it is on the disk.

    Raises:
        RecordingError: If it cannot be written.
    """
    path = part_path(folder, seed)
    with written_whole(path, RecordingError, parents=False, sync=sync) as partial:
        partial.write_bytes(part)


def part_path(folder: Path, seed: int) -> Path:
    """Return the part of a seed; names sort as seeds do."""
    return folder / f"seed-{seed:010d}{_SUFFIX}"


def seed_of(part: Path) -> int:
    """Return the seed of a part, from its name.

    Raises:
        ValueError: If it is not the name of a part.
    """
    found = _SEED.fullmatch(part.stem)
    seed = int(found[1]) if found and part.suffix == _SUFFIX else -1
    if not 0 <= seed <= MAX_SEED or part_path(part.parent, seed) != part:
        raise ValueError(f"{part.name} is not the name of a part")
    return seed


def list_parts(folder: Path) -> list[Path]:
    """Return the parts in a folder, sorted by seed; none if there is no folder."""
    return sorted(path for path in folder.glob(f"seed-*{_SUFFIX}") if _is_part(path))


def refuse_foreign(folder: Path) -> None:
    """Refuse a folder of parts that holds something else, which must not be deleted.

    Raises:
        RecordingError: If so.
    """
    for path in sorted(folder.iterdir()):
        ours = path.suffix == PARTIAL or _is_part(path)
        if not ours or path.is_symlink() or not path.is_file():
            raise RecordingError(
                f"{path} is no episode of this library, in a folder that is for such episodes only;"
                " move it somewhere else"
            )


def part_size(part: bytes) -> int:
    """Return the `Stored.size` of an episode that was just encoded."""
    about, numbers = part.split(b"\n", 3)[2:]
    described = json.loads(about)
    return _size(described["attributes"], len(described["arrays"]), len(numbers) - _CHECKSUM)


def read_part(path: Path) -> tuple[dict[str, Any], Stored]:
    """Return the header of a part and its episode.

    Raises:
        RecordingError: If it is damaged, or the episode of another seed than its name says.
        UnreadableFileError: If it cannot be read.
    """
    content = read_regular(path, _MAX_PART)
    whole, checksum = content[:-_CHECKSUM], content[-_CHECKSUM:]
    if not whole.startswith(_OPENING) or checksum != _checksum(whole):
        raise RecordingError(f"{path} is damaged, or not an episode of this library")
    try:
        header, stored = _parse(whole.removeprefix(_OPENING))
    except ValueError as error:
        raise RecordingError(f"{path} is not an episode of this library: {error}") from error
    seed = stored.about["episode_seed"]
    if seed != seed_of(path):
        raise RecordingError(f"{path} is the episode of seed {seed}, under another's name")
    return header, stored


def _parse(content: bytes) -> tuple[dict[str, Any], Stored]:
    """Return what a part says after its opening.

    Raises:
        ValueError: If it is not as `PartEncoder` writes it.
    """
    header, about, numbers = content.split(b"\n", 2)
    described, listed = _parse_header(header), parse_json(about.decode())
    check(listed, _Content, "")
    arrays: dict[str, NDArray[Any]] = {}
    start = 0
    for array in listed["arrays"]:
        name, dtype, shape = array
        count = min(math.prod(shape), MAX_BYTES)
        arrays[name] = np.frombuffer(numbers, dtype, count, start).reshape(shape).copy()  # aligned
        start += arrays[name].nbytes
    about = parse_json(listed["attributes"]["episode"])
    check(about, OwnEpisode, "episode")
    if start != len(numbers) or len(arrays.get("actions", ())) != about["elapsed_steps"]:
        raise FieldError("its arrays are not those of its steps")
    return described, Stored(listed["attributes"], arrays)


@lru_cache(maxsize=1)  # all parts of a recording have the same
def _parse_header(content: bytes) -> dict[str, Any]:
    header = parse_json(content.decode())
    check(header, Object, "header")
    return header


def _is_part(path: Path) -> bool:
    try:
        seed_of(path)
    except ValueError:
        return False
    return True


def _arrays(episode: PlayedEpisode) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}  # in ManiSkill's order
    if episode.observations is not None:
        arrays.update(leaves(episode.observations, OBSERVATIONS, NOTHING))
    for name in ("actions", "terminated", "truncated", "success"):
        arrays[name] = getattr(episode, name)
    for kind, entries in episode.states.items():
        arrays.update({f"{STATES}{kind}/{name}": rows for name, rows in entries.items()})
    for name in ("rewards", "actor", "corrections"):
        if (rows := getattr(episode, name)) is not None:
            arrays[name] = rows
    return arrays


def _size(attributes: Mapping[str, str], arrays: int, numbers: int) -> int:
    return numbers + arrays * _ARRAY_BYTES + sum(map(len, attributes.values())) + _GROUP_BYTES


def _checksum(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_CHECKSUM, "little")


class JoinedEpisode(NamedTuple):
    """An episode that is in an h5 file.

    Attributes:
        group: Its group there.
        about: Its json.
        size: Its `Stored.size`.
    """

    group: str
    about: dict[str, Any]
    size: int


def read_joined(path: Path) -> tuple[dict[str, Any], dict[int, JoinedEpisode], list[str]]:
    """Read a recording that was written here; every episode's checksum is compared.

    Returns:
        What its episodes have in common; the episodes by seed, ascending; and the groups of those
        that are damaged.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    episodes: dict[int, JoinedEpisode] = {}
    damaged: list[str] = []
    with damage_errors(lambda reason: damaged_recording(path, reason)), Hdf5File(path) as file:
        header = _header(file)
        for name in file.members():
            if not _GROUP.fullmatch(name):
                raise FieldError(f"{name} is no episode")
            try:
                with damage_errors(RecordingError):
                    stored = read_joined_episode(file, name)
            except RecordingError:
                damaged.append(name)
                continue
            if (seed := stored.about["episode_seed"]) in episodes:
                raise FieldError("it holds two episodes of one seed")
            episodes[seed] = JoinedEpisode(name, stored.about, stored.size)
    return header, dict(sorted(episodes.items())), damaged


def read_header(path: Path) -> dict[str, Any]:
    """Return what the episodes of a recording have in common.

    Raises:
        RecordingError: If it was not written here, or is damaged as a whole.
    """
    with damage_errors(lambda reason: damaged_recording(path, reason)), Hdf5File(path) as file:
        return _header(file)


Place = Path | str | Callable[[], Stored]
"""Where an episode is: a part, a group of the present file, or what reads it."""


def join(
    path: Path, header: Mapping[str, Any], places: Mapping[int, Place]
) -> dict[int, JoinedEpisode]:
    """Write episodes into one h5 file, numbered in the order given, in place of what is there.

    The bytes of the file depend on its episodes only, not on whether they come from parts or from
    another file: nothing has a time stamp, and names are written in sorted order, or in ManiSkill's
    where there are observations, which the file then keeps.

    Args:
        path: The file; it is replaced in one step, when the new one is complete and on the disk.
        header: What the episodes have in common.
        places: What to join, by seed.

    Raises:
        RecordingError: If it cannot be written, or an episode not be read; nothing is changed.
    """
    episodes: dict[int, JoinedEpisode] = {}
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
            elif callable(place):
                stored = place()
            else:
                assert present is not None  # its groups were listed
                stored = read_joined_episode(present, place)
            _write_episode(file, f"traj_{number}", stored)
            episodes[seed] = JoinedEpisode(f"traj_{number}", stored.about, stored.size)
    return episodes


def _write_episode(file: h5py.File, name: str, stored: Stored) -> None:
    ordered = ORDER in stored.attributes
    groups = {"": _new_group(file, name, ordered=ordered)}
    own = checksums(stored.attributes, stored.arrays)
    for key, text in sorted({**stored.attributes, **own}.items()):
        groups[""].attrs.create(key, text, dtype=_TEXT)
    for key in stored.arrays if ordered else sorted(stored.arrays):
        above = ""
        *path, last = key.split("/")
        for part in path:
            inside = f"{above}/{part}"
            if inside not in groups:
                groups[inside] = _new_group(groups[above], part, ordered=ordered)
            above = inside
        if last:
            _write_array(groups[above], last, stored.arrays[key], _is_observed(key))


def _is_observed(name: str) -> bool:
    return name.partition("/")[0] == OBSERVATIONS


def _write_array(group: h5py.Group, name: str, rows: NDArray[Any], observed: bool) -> None:
    """Write what `create_dataset` would, at a third of its cost; pictures as ManiSkill does."""
    if observed and name in _PACKED:
        group.create_dataset(name, data=rows, compression="gzip", compression_opts=5)
        return
    kind, space = _HDF5.h5t.py_create(rows.dtype, logical=True), _HDF5.h5s.create_simple(rows.shape)
    properties = _HDF5.h5p.create(_HDF5.h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    properties.set_fill_time(_HDF5.h5d.FILL_TIME_IFSET)
    dataset = _HDF5.h5d.create(group.id, name.encode(), kind, space, properties)
    dataset.write(_HDF5.h5s.ALL, _HDF5.h5s.ALL, rows, kind)


def _new_group(above: h5py.Group, name: str, *, ordered: bool) -> h5py.Group:
    """Make a group without a time stamp, which `create_group` of older h5py writes.

    Args:
        above: Where.
        name: Its name.
        ordered: Whether it keeps the order in which its members are written.
    """
    properties = _HDF5.h5p.create(_HDF5.h5p.GROUP_CREATE)
    properties.set_obj_track_times(False)
    if ordered:
        properties.set_link_creation_order(
            _HDF5.h5p.CRT_ORDER_TRACKED | _HDF5.h5p.CRT_ORDER_INDEXED
        )
    return h5py.Group(_HDF5.h5g.create(above.id, name.encode(), None, properties))


def _header(file: Hdf5File) -> dict[str, Any]:
    header = {name: parse_json(text) for name, text in (file.texts() or {}).items()}
    if "env_info" not in header:
        raise FieldError("it does not say what was recorded")
    return header


def read_joined_episode(file: Hdf5File, name: str) -> Stored:
    """Read an episode that was written here.

    Raises:
        ValueError: If its checksum is another, or it is no episode.
    """
    attributes = file.texts(name) or {}
    arrays = in_order(file.numbers(name, empty=True), attributes)
    for kind, own in checksums(attributes, arrays).items():
        if attributes.pop(kind, own) != own:  # an earlier version wrote none
            raise FieldError(f"the checksum of {name} is another")
    if read_described(attributes, "episode", OwnEpisode) is None:
        raise FieldError(f"{name} has no attribute 'episode'")
    return Stored(attributes, arrays)


def damaged_recording(path: Path, reason: str) -> RecordingError:
    """Return the error that says why an h5 file cannot be read."""
    return RecordingError(f"{path} is no recording of this library, or it is damaged: {reason}")
