"""Hostile arrays: each array of an episode as everything else that HDF5 has in store."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.faults.fault import Fault
from tests.faults.recording_files import AREA, BODY, read_edited

Edit = Callable[[h5py.Group, str, tuple[int, ...], Path], None]

# Each array of an episode, and its shape there.
ARRAYS = {"actions": (3, 7), "rewards": (3,), "success": (3,), BODY: (4, 13)}


def faults() -> Iterator[Fault]:
    """Go through them."""
    for array, shape in ARRAYS.items():
        for what, edit in _replacements():
            run = partial(_replace, array, shape, edit)
            yield Fault(AREA, f"h5: {array} is {what}", run)


def _replace(array: str, shape: tuple[int, ...], edit: Edit, folder: Path) -> None:
    def replace(file: h5py.File, folder: Path) -> None:
        above, _, name = array.rpartition("/")
        group = file[f"traj_0/{above}"] if above else file["traj_0"]
        del group[name]
        edit(group, name, shape, folder)

    read_edited(folder, replace)


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
    for what, values in {
        "texts": np.array([b"abc"] * 3),
        "complex numbers": np.zeros(3, complex),
        "records": np.zeros(3, [("a", "f4")]),
        "of other length": np.zeros((9, 7), "f4"),
        "empty": np.zeros((0, 7), "f4"),
        "a single number": np.float32(1),
        "halves of long doubles": np.zeros((3, 7), np.longdouble),
    }.items():
        yield what, lambda g, n, s, f, v=values: g.create_dataset(n, data=v)
    for number in (np.nan, np.inf):
        yield (
            f"full of {number}",
            lambda g, n, s, f, v=number: g.create_dataset(n, data=np.full(s, v, "f4")),
        )
    for what, kind in {
        "texts of any length": h5py.string_dtype(),
        "lists of any length": h5py.vlen_dtype(np.float32),
        "references": h5py.ref_dtype,
        "an enumeration": h5py.enum_dtype({"a": 1, "b": 2, "c": 3}),
    }.items():
        yield what, lambda g, n, s, f, k=kind: g.create_dataset(n, s, k)
    yield "nothing", lambda g, n, s, f: _set(g, n, h5py.Empty("f4"))
    yield "a datatype", lambda g, n, s, f: _set(g, n, np.dtype("f4"))
    yield "of a named datatype", _named_type
    yield "declared, but not there", lambda g, n, s, f: g.create_dataset(n, s, "f4")
    yield "2^31 rows of gzipped zeros", lambda g, n, s, f: _bomb(g, n, s, 2**31)
    yield "10^12 rows", lambda g, n, s, f: _bomb(g, n, s, 10**12)
    for filters in ({"compression": "lzf"}, {"scaleoffset": 2}):
        yield (
            f"packed with {filters}",
            lambda g, n, s, f, how=filters: g.create_dataset(
                n, data=np.zeros(s, "f4"), chunks=s, **how
            ),
        )
    yield "packed by unknown code", lambda g, n, s, f: _unknown_filter(g, n, s)
    yield "a gzip bomb in a chunk", lambda g, n, s, f: _chunk(g, n, s, _zeros(10**8))
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
