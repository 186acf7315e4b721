"""Hostile h5 files: everything in a file of episodes that could be something else."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.faults.fault import GOES_ON, Fault
from tests.faults.recording_files import (
    AREA,
    BODY,
    SECRET,
    contents,
    edited,
    expect_whole,
    read,
    recording,
)

Edit = Callable[[h5py.Group, str, tuple[int, ...], Path], None]

# Each array of an episode, and its shape there.
ARRAYS = {"actions": (3, 7), "rewards": (3,), "success": (3,), BODY: (4, 13)}


def faults() -> Iterator[Fault]:
    """Go through them."""
    for array, shape in ARRAYS.items():
        for what, edit in _replacements():
            yield Fault(
                AREA,
                f"h5: {array} is {what}",
                lambda folder, a=array, s=shape, e=edit: _replace(folder, a, s, e),
            )
    for what, edit in _GROUPS.items():
        yield Fault(AREA, f"h5: {what}", lambda folder, e=edit: _edit(folder, e))
    for name in ("layout", "simulation"):
        for what, value in _ATTRIBUTES.items():
            yield Fault(
                AREA,
                f"h5: attribute {name} is {what}",
                lambda folder, n=name, v=value: _edit(
                    folder, lambda file, _: _attribute(file, n, v)
                ),
            )
    for what, layout in _LAYOUTS.items():
        yield Fault(
            AREA,
            f"h5: attribute layout has {what}",
            lambda folder, edit=layout: _edit(folder, lambda file, _: _layout(file, edit)),
        )
    for name in ("episode", "checksum"):
        for what, value in _ATTRIBUTES.items():
            yield Fault(
                AREA,
                f"h5: attribute {name} of an episode is {what}",
                lambda folder, n=name, v=value: _keep_checksum(folder, n, v),
            )
    for what, change in _FILES.items():
        yield Fault(AREA, f"h5: the file is {what}", lambda folder, c=change: _file(folder, c))
    for what, change in _HARMLESS.items():
        yield Fault(AREA, f"h5: {what}", lambda folder, c=change: _harmless(folder, c), GOES_ON)


def _replace(folder: Path, array: str, shape: tuple[int, ...], edit: Edit) -> None:
    def change(file: h5py.File, folder: Path) -> None:
        above, _, name = array.rpartition("/")
        group = file[f"traj_0/{above}"] if above else file["traj_0"]
        del group[name]
        edit(group, name, shape, folder)

    _edit(folder, change)


def _edit(folder: Path, edit: Callable[[h5py.File, Path], None]) -> None:
    path = recording(folder)
    (folder / "secret").write_bytes(SECRET)
    with edited(path) as file:
        edit(file, folder)
    for episode in read(path):
        for rows in (episode.actions, episode.rewards):
            assert rows is None or SECRET[:8] not in rows.tobytes(), "read another file"


def _replacements() -> Iterator[tuple[str, Edit]]:
    yield "a link to another file", lambda g, n, s, f: _other_h5(g, n, s, f)
    yield "a link that leads nowhere", lambda g, n, s, f: _set(g, n, h5py.SoftLink("/nowhere"))
    yield "a link to itself", lambda g, n, s, f: _set(g, n, h5py.SoftLink(f"{g.name}/{n}"))
    yield "a link to another episode", lambda g, n, s, f: _set(g, n, h5py.SoftLink(f"/traj_1/{n}"))
    yield (
        "in another file",
        lambda g, n, s, f: g.create_dataset(
            n, s, "f4", external=[(str(f / "secret"), 0, h5py.h5f.UNLIMITED)]
        ),
    )
    yield (
        "in a FIFO",
        lambda g, n, s, f: (
            os.mkfifo(f / "fifo"),
            g.create_dataset(n, s, "f4", external=[(str(f / "fifo"), 0, h5py.h5f.UNLIMITED)]),
        ),
    )
    yield "virtual", lambda g, n, s, f: _virtual(g, n, s, str(f / "secret"))
    yield (
        "virtual, of a FIFO",
        lambda g, n, s, f: (
            os.mkfifo(f / "fifo"),
            _virtual(g, n, s, str(f / "fifo")),
        ),
    )
    for what, values in {
        "texts": np.array([b"abc"] * 3),
        "complex numbers": np.zeros(3, complex),
        "records": np.zeros(3, [("a", "f4")]),
        "opaque": np.zeros(3, "V8"),
        "of other length": np.zeros((9, 7), "f4"),
        "empty": np.zeros((0, 7), "f4"),
        "a single number": np.float32(1),
        "of four dimensions": np.zeros((3, 1, 1, 1), "f4"),
        "halves of long doubles": np.zeros((3, 7), np.longdouble),
    }.items():
        yield what, lambda g, n, s, f, v=values: g.create_dataset(n, data=v)
    for number in (np.nan, np.inf, -np.inf):
        yield (
            f"full of {number}",
            lambda g, n, s, f, v=number: g.create_dataset(n, data=np.full(s, v, "f4")),
        )
    for what, kind in {
        "texts of any length": h5py.string_dtype(),
        "lists of any length": h5py.vlen_dtype(np.float32),
        "references": h5py.ref_dtype,
        "references to regions": h5py.regionref_dtype,
        "an enumeration": h5py.enum_dtype({"a": 1, "b": 2, "c": 3}),
    }.items():
        yield what, lambda g, n, s, f, k=kind: g.create_dataset(n, s, k)
    yield "nothing", lambda g, n, s, f: _set(g, n, h5py.Empty("f4"))
    yield "a datatype", lambda g, n, s, f: _set(g, n, np.dtype("f4"))
    yield "of a named datatype", _named_type
    yield "declared, but not there", lambda g, n, s, f: g.create_dataset(n, s, "f4")
    yield "2^31 rows of gzipped zeros", lambda g, n, s, f: _bomb(g, n, s, 2**31)
    yield "10^12 rows", lambda g, n, s, f: _bomb(g, n, s, 10**12)
    for filters in ({"compression": "lzf"}, {"compression": "szip"}, {"scaleoffset": 2}):
        if "szip" not in filters.values():
            yield (
                f"packed with {filters}",
                lambda g, n, s, f, how=filters: g.create_dataset(
                    n, data=np.zeros(s, "f4"), chunks=s, **how
                ),
            )
    yield "packed by unknown code", lambda g, n, s, f: _unknown_filter(g, n, s)
    yield "a gzip bomb in a chunk", lambda g, n, s, f: _chunk(g, n, s, _zeros(10**8))
    yield "a chunk that is too short", lambda g, n, s, f: _chunk(g, n, s, _zeros(4))
    yield "a chunk that is not gzip", lambda g, n, s, f: _chunk(g, n, s, b"not gzip")
    yield "a chunk that pretends not to be packed", lambda g, n, s, f: _chunk(g, n, s, b"1234", 1)


def _set(group: h5py.Group, name: str, value: Any) -> None:
    group[name] = value


def _other_h5(group: h5py.Group, name: str, shape: tuple[int, ...], folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["numbers"] = np.zeros(shape, "f4")
    group[name] = h5py.ExternalLink(str(folder / "other.h5"), "/numbers")


def _virtual(group: h5py.Group, name: str, shape: tuple[int, ...], source: str) -> None:
    layout = h5py.VirtualLayout(shape, "f4")
    layout[...] = h5py.VirtualSource(source, "numbers", shape)
    group.create_virtual_dataset(name, layout)


def _named_type(group: h5py.Group, name: str, shape: tuple[int, ...], folder: Path) -> None:
    group.file["type"] = np.dtype("f4")
    group.create_dataset(name, data=np.zeros(shape, "f4"), dtype=group.file["type"])


def _bomb(group: h5py.Group, name: str, shape: tuple[int, ...], rows: int) -> None:
    chunk = (2**20, *shape[1:])
    group.create_dataset(name, (rows, *shape[1:]), "f4", chunks=chunk, compression="gzip")[0] = 0


def _unknown_filter(group: h5py.Group, name: str, shape: tuple[int, ...]) -> None:
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk(shape)
    properties.set_filter(32123, h5py.h5z.FLAG_OPTIONAL, (1, 2))
    space = h5py.h5s.create_simple(shape)
    made = h5py.h5d.create(group.id, name.encode(), h5py.h5t.NATIVE_FLOAT, space, properties)
    made.write_direct_chunk((0,) * len(shape), b"\0" * int(4 * np.prod(shape)), 0)


def _chunk(
    group: h5py.Group, name: str, shape: tuple[int, ...], packed: bytes, mask: int = 0
) -> None:
    made = group.create_dataset(name, shape, "f4", chunks=shape, compression="gzip")
    made.id.write_direct_chunk((0,) * len(shape), packed, mask)


def _zeros(count: int) -> bytes:
    import zlib

    return zlib.compress(bytes(count))


def _cycle(file: h5py.File, folder: Path) -> None:
    file["traj_0/env_states/again"] = file["traj_0"]


def _deep(file: h5py.File, folder: Path) -> None:
    group = file["traj_0/env_states"]
    for _ in range(500):
        group = group.create_group("deeper")
    group["rows"] = np.zeros((4, 1), "f4")


def _wide(file: h5py.File, folder: Path) -> None:
    for number in range(10_001):
        file["traj_0/env_states/actors"].create_group(str(number))


def _many_of_one(file: h5py.File, folder: Path) -> None:
    rows = np.zeros((4, 2**22), "f4")
    file["large"] = rows
    for number in range(20):
        file[f"traj_0/env_states/actors/{number}"] = file["large"]


def _delete(name: str) -> Callable[[h5py.File, Path], None]:
    return lambda file, folder: file.__delitem__(name)


def _instead(name: str, value: Any) -> Callable[[h5py.File, Path], None]:
    def edit(file: h5py.File, folder: Path) -> None:
        del file[name]
        file[name] = value

    return edit


_GROUPS: dict[str, Callable[[h5py.File, Path], None]] = {
    "an episode is not there": _delete("traj_1"),
    "an episode is an array": _instead("traj_1", np.zeros((3, 7), "f4")),
    "an episode is a datatype": _instead("traj_1", np.dtype("f4")),
    "an episode is a link to another file": lambda file, folder: (
        file.__delitem__("traj_1"),
        file.__setitem__("traj_1", h5py.ExternalLink(str(folder / "secret"), "/")),
    ),
    "an episode is a link to another episode": _instead("traj_1", h5py.SoftLink("/traj_0")),
    "an episode is a link to the file": _instead("traj_1", h5py.SoftLink("/")),
    "an episode is another episode, too": lambda file, folder: (
        file.__delitem__("traj_1"),
        file.__setitem__("traj_1", file["traj_0"]),
    ),
    "an episode contains itself": _cycle,
    "states are 500 groups deep": _deep,
    "10,001 groups are where bodies are": _wide,
    "one large array has 20 names": _many_of_one,
    "actions are by robot": _instead("traj_0/actions", {}),
    "states are an array": _instead("traj_0/env_states", np.zeros((4, 3), "f4")),
    "states are not by kind": _instead("traj_0/env_states/actors", np.zeros((4, 3), "f4")),
    "states are by kind, name and more": lambda file, folder: file.__setitem__(
        "traj_0/env_states/actors/more/rows", np.zeros((4, 3), "f4")
    ),
    "states are in another file": lambda file, folder: (
        file.__delitem__("traj_0/env_states"),
        file.__setitem__("traj_0/env_states", h5py.ExternalLink(str(folder / "secret"), "/")),
    ),
}
_GROUPS["actions are by robot"] = lambda file, folder: (
    file.__delitem__("traj_0/actions"),
    file.__setitem__("traj_0/actions/panda-0", np.zeros((3, 7), "f4")),
)

_ATTRIBUTES: dict[str, Any] = {
    "a number": 3,
    "an array of numbers": np.zeros(5),
    "ten million numbers": "many",
    "an array of texts": np.array(["{}", "{}"], h5py.string_dtype()),
    "not json": "{",
    "empty": "",
    "the json of a number": "3",
    "the json of a list": "[1, 2]",
    "the json of a text": '"text"',
    "json with a key twice": '{"arm": 1, "arm": 2}',
    "json 100,000 deep": "[" * 100_000,
    "json with a number of 5,000 digits": "9" * 5000,
    "a reference": "reference",
    "not UTF-8": np.bytes_(b"\xff\xfe{}"),
    "nothing at all": h5py.Empty("f4"),
}


def _attribute(holder: Any, name: str, value: Any) -> None:
    holder.attrs.pop(name, None)
    if isinstance(value, str) and value == "reference":
        holder.attrs.create(name, holder.file["traj_0"].ref, dtype=h5py.ref_dtype)
    elif isinstance(value, str) and value == "many":
        file = h5py.File(holder.file.filename, "r+", libver="latest")
        holder = file[holder.name]
        holder.attrs[name] = np.zeros(10**7)
    else:
        holder.attrs[name] = value


def _keep_checksum(folder: Path, name: str, value: Any) -> None:
    path = recording(folder)
    with h5py.File(path, "r+") as file:
        _attribute(file["traj_0"], name, value)
    read(path)


def _layout(file: h5py.File, edit: Callable[[dict[str, Any]], None]) -> None:
    described = json.loads(file.attrs["layout"])
    edit(described)
    file.attrs["layout"] = json.dumps(described)


def _robot(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def edit(described: dict[str, Any]) -> None:
        if value is None:
            del described["arm"][name]
        else:
            described["arm"][name] = value

    return edit


_LAYOUTS: dict[str, Callable[[dict[str, Any]], None]] = {
    "a robot that is a list": lambda described: described.update(arm=[1, 2]),
    "a robot that is a text": lambda described: described.update(arm="panda"),
    "a robot that is null": lambda described: described.update(arm=None),
    **{
        f"{name} = {value!r:.40}": _robot(name, value)
        for name, values in {
            "action": [None, "ab", ["a", "b", "c", "d"], [0], [0, "7"], [0, 7.5], [-1, 6], [7, 0]]
            + [[1, 8], [0, 10**30], [True, 7], {"a": 1}],
            "position": [None, "far", [0, 0], [0, 0, "x"], [0, 0, float("nan")], [0, 0, 10**400]],
            "quaternion": [None, 1, [1, 0, 0], [1, 0, 0, None], [float("inf"), 0, 0, 0]],
            "robot": [None, 5, "", "x" * 500, ["panda"]],
            "keyframe": [5, ["rest"], "k" * 500],
            "qpos_noise": [None, "much", float("nan"), [0.1]],
        }.items()
        for value in values
    },
}


def _file(folder: Path, change: Callable[[Path], None]) -> None:
    path = recording(folder)
    change(path)
    read(path)


def _write(make: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.write_bytes(make(contents()[0]))

    return change


def _put(make: Callable[[Path], Any]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.unlink()
        make(path)

    return change


def _endless_texts(content: bytes) -> bytes:
    """Say that after the first text there is free space of no size: HDF5 looks on for ever."""
    first = content.index(b"GCOL") + 16
    size = int.from_bytes(content[first + 8 : first + 16], "little")
    second = first + 16 + -(-size // 8) * 8
    return content[:second] + bytes(16) + content[second + 16 :]


_FILES: dict[str, Callable[[Path], None]] = {
    "missing": lambda path: path.unlink(),
    "a directory": _put(lambda path: path.mkdir()),
    "a FIFO": _put(os.mkfifo),
    "/dev/zero": _put(lambda path: path.symlink_to("/dev/zero")),
    "a link to itself": _put(lambda path: path.symlink_to(path)),
    "empty": _write(lambda content: b""),
    "a text": _write(lambda content: b"not even h5"),
    "zeros": _write(lambda content: bytes(len(content))),
    "a zip": _write(lambda content: b"PK\x03\x04" + content[4:]),
    "only a signature": _write(lambda content: content[:8]),
    **{
        f"cut to {share:.1%}": _write(lambda content, s=share: content[: int(s * len(content))])
        for share in (0.01, 0.1, 0.3, 0.5, 0.9, 0.999)
    },
    "cut at its front": _write(lambda content: content[1:]),
    "the numbers of another": _write(lambda content: content[:2000] + content[2008:] + bytes(8)),
    "of texts without end": _write(_endless_texts),
}


def _harmless(folder: Path, change: Callable[[Path], None]) -> None:
    path = recording(folder)
    change(path)
    expect_whole(path)


def _repack(**how: Any) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with edited(path) as file:
            for episode in file.values():
                for name in (*("actions", "rewards", "success"), BODY):
                    rows = episode[name][()]
                    del episode[name]
                    episode.create_dataset(name, data=rows, **how)

    return change


def _userblock(path: Path) -> None:
    path.write_bytes(b"#!/bin/sh\n".ljust(512) + path.read_bytes())


def _bystander(path: Path) -> None:
    with edited(path) as file:
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")
        file["traj_0/obs"] = h5py.SoftLink("/nowhere")


_HARMLESS: dict[str, Callable[[Path], None]] = {
    "arrays are packed by gzip": _repack(compression="gzip"),
    "arrays are packed by shuffle and gzip, with checksums": _repack(
        compression="gzip", shuffle=True, fletcher32=True
    ),
    "arrays are in chunks": _repack(chunks=True),
    "arrays may grow": _repack(maxshape=None, chunks=True),
    "a script stands before the h5 file": _userblock,
    "there are links to other files that nothing reads": _bystander,
    "the h5 file has no checksums, as those of earlier versions": _repack(),
}
