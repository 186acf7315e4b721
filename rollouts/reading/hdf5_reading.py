"""Reads h5 files that may come from anyone: plain arrays and texts inside the file, nothing else.

HDF5 files can name other files (external links, external storage, virtual datasets), code to load
(filters), and arrays of any size at no cost. Everything is therefore looked at before it is read,
by h5py's low-level interface, which follows nothing by itself. The HDF5 library itself may crash on
damaged files, or never come to an end: `rollouts.reading.hdf5_file` has all this done in another
process.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

MAX_BYTES = 2**30  # of one episode's arrays
MAX_ARRAYS = 10_000  # of one episode
MAX_DEPTH = 4  # groups of an episode inside one another: env_states/actors/cube is 2 deep
MAX_CHUNK = 2**26  # bytes of a chunk, unpacked; h5py itself makes chunks of at most 1 MiB
MAX_ATTRIBUTES = 100  # of one group

_HDF5: Any = h5py  # whose low-level modules pyright cannot look into
_LAYOUTS = (_HDF5.h5d.COMPACT, _HDF5.h5d.CONTIGUOUS, _HDF5.h5d.CHUNKED)
_NUMBERS = (_HDF5.h5t.INTEGER, _HDF5.h5t.FLOAT, _HDF5.h5t.ENUM)
_SHUFFLE, _GZIP, _CHECK = (
    getattr(_HDF5.h5z, f"FILTER_{name}") for name in ("SHUFFLE", "DEFLATE", "FLETCHER32")
)
# In this order, as h5py applies them; each may be left out. All of them are part of HDF5.
_PIPELINES = [
    [*shuffle, *pack, *check]
    for shuffle in ([], [_SHUFFLE])
    for pack in ([], [_GZIP])
    for check in ([], [_CHECK])
]
_CHECK_BYTES = 4  # that fletcher32 adds


class ContentError(ValueError):
    """Something in an h5 file that is not read; the message says what, without the file's name."""


def root(file: h5py.File) -> Hdf5Group:
    """Return what is in a file."""
    return Hdf5Group(file.id)


@dataclass(frozen=True)
class Hdf5Group:
    """A group of an h5 file."""

    identifier: Any

    def names(self) -> list[str]:
        """Return the names of what is directly in it."""
        return [name.decode() for name in self.identifier]

    def open(self, name: str) -> Hdf5Group | Hdf5Array | None:
        """Return the group or array of a name in it; None if there is none.

        Raises:
            ContentError: If it is a link to somewhere else, a datatype, or an array that cannot
                be read safely.
        """
        key = name.encode()
        if key not in self.identifier:
            return None
        if self.identifier.links.get_info(key).type != _HDF5.h5l.TYPE_HARD:
            raise ContentError(f"{name} is a link to somewhere else")
        found = _HDF5.h5o.open(self.identifier, key)
        if isinstance(found, _HDF5.h5g.GroupID):
            return Hdf5Group(found)
        if isinstance(found, _HDF5.h5d.DatasetID):
            return _array(name, found)
        raise ContentError(f"{name} is neither a group nor an array")

    def arrays(self, names: Collection[str] | None = None) -> dict[str, Hdf5Array]:
        """Return all arrays in it and in its groups, by names such as ``env_states/actors/cube``.

        Args:
            names: What to look at directly in this group; everything if None.

        Raises:
            ContentError: If something cannot be read safely, the groups nest too deep, or there
                is too much of it.
        """
        found = dict(islice(self._walk(names), MAX_ARRAYS + 1))
        if len(found) > MAX_ARRAYS:
            raise ContentError(f"it has more than {MAX_ARRAYS:,} arrays")
        size = sum(array.nbytes for array in found.values())
        if size > MAX_BYTES:
            raise ContentError(f"its arrays have {size:,} bytes, more than {MAX_BYTES:,}")
        return found

    def texts(self, names: Collection[str] | None = None) -> dict[str, str]:
        """Return attributes, which must be texts; those that are not there are left out.

        Args:
            names: Which; all if None.

        Raises:
            ContentError: If one is not, or there are too many.
        """
        count = _HDF5.h5a.get_num_attrs(self.identifier)
        if count > MAX_ATTRIBUTES:
            raise ContentError(f"it has {count:,} attributes, more than {MAX_ATTRIBUTES}")
        found: list[bytes] = []
        _HDF5.h5a.iterate(self.identifier, found.append)
        keys = {name.decode(): name for name in found}
        wanted = keys if names is None else [name for name in names if name in keys]
        return {name: _text(self.identifier, keys[name]) for name in wanted}

    def _walk(
        self, names: Collection[str] | None, prefix: str = "", depth: int = 0
    ) -> Iterator[tuple[str, Hdf5Array]]:
        if depth > MAX_DEPTH:
            raise ContentError(f"its groups are nested deeper than {MAX_DEPTH}")
        if self.identifier.get_num_objs() > MAX_ARRAYS:
            raise ContentError(f"a group in it has more than {MAX_ARRAYS:,} members")
        for name in self.names() if names is None else names:
            member = self.open(name)
            if isinstance(member, Hdf5Group):
                yield from member._walk(None, f"{prefix}{name}/", depth + 1)
            elif member is not None:
                yield f"{prefix}{name}", member


@dataclass(frozen=True)
class Hdf5Array:
    """An array of an h5 file that can be read safely.

    Attributes:
        shape: Its declared shape.
        dtype: Numbers or flags.
        identifier: h5py's own.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    identifier: Any

    @property
    def nbytes(self) -> int:
        """Its size in memory (bytes)."""
        return math.prod(self.shape) * self.dtype.itemsize

    def read(self) -> NDArray[Any]:
        """Return its numbers.

        Raises:
            ContentError: If a chunk of it unpacks to more than it declares.
        """
        rows = np.empty(self.shape, self.dtype)
        if rows.size:
            _check_chunks(self.identifier)
            self.identifier.read(_HDF5.h5s.ALL, _HDF5.h5s.ALL, rows)
        if rows.dtype.kind == "b" and (rows.view(np.uint8) > 1).any():
            raise ContentError("a flag is neither true nor false")
        return rows


def _array(name: str, identifier: Any) -> Hdf5Array:
    """Look at a dataset; where its numbers are comes first, as even its shape may be elsewhere."""
    properties = identifier.get_create_plist()
    if properties.get_layout() not in _LAYOUTS:
        raise ContentError(f"{name} is a virtual array, whose numbers are in other files")
    if properties.get_external_count():
        raise ContentError(f"the numbers of {name} are in other files")
    filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if filters not in _PIPELINES:
        raise ContentError(
            f"{name} is packed by HDF5 filters {filters}; only shuffle, gzip and fletcher32 are"
            f" read, {[_SHUFFLE, _GZIP, _CHECK]}, in this order"
        )
    kind = identifier.get_type()
    if kind.get_class() not in _NUMBERS or kind.committed():
        raise ContentError(f"{name} holds no plain numbers")
    if kind.get_class() == _HDF5.h5t.ENUM and kind.get_nmembers() != 2:
        raise ContentError(f"{name} holds an enumeration")
    dtype: np.dtype[Any] = kind.dtype
    if dtype.kind not in "bfiu" or dtype.itemsize > 8:
        raise ContentError(f"{name} holds {dtype}, which is none of the usual kinds of numbers")
    space = identifier.get_space()
    if space.get_simple_extent_type() != _HDF5.h5s.SIMPLE:
        raise ContentError(f"{name} holds a single value, or none")
    array = Hdf5Array(space.get_simple_extent_dims(), dtype, identifier)
    _check_size(name, array, properties)
    return array


def _check_size(name: str, array: Hdf5Array, properties: Any) -> None:
    """Refuse an array that declares more numbers than there can be in the file."""
    if array.nbytes > MAX_BYTES:
        raise ContentError(
            f"{name} declares shape {array.shape}, {array.nbytes:,} bytes; at most"
            f" {MAX_BYTES:,} are read"
        )
    if properties.get_layout() == _HDF5.h5d.CHUNKED:
        chunk = properties.get_chunk()
        if math.prod(chunk) * array.dtype.itemsize > MAX_CHUNK:
            raise ContentError(f"{name} has chunks {chunk}; at most {MAX_CHUNK:,} bytes are read")
        sides = [-(-size // step) for size, step in zip(array.shape, chunk, strict=True)]
        whole = math.prod(sides) == array.identifier.get_num_chunks()
    else:
        whole = array.nbytes == array.identifier.get_storage_size()
    if array.nbytes and not whole:
        raise ContentError(f"{name} declares shape {array.shape}, but not all of it is in the file")


def _check_chunks(identifier: Any) -> None:
    """Refuse chunks that unpack to more than they should, which HDF5 itself would do."""
    properties = identifier.get_create_plist()
    filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if not filters:
        return
    size = math.prod(properties.get_chunk()) * identifier.get_type().get_size()
    for number in range(identifier.get_num_chunks()):
        chunk = identifier.get_chunk_info(number)
        if _GZIP not in filters or chunk.filter_mask:
            whole = size <= chunk.size <= size + _CHECK_BYTES
        elif whole := chunk.size <= 2 * size + 1024:  # packing may make it larger
            _, packed = identifier.read_direct_chunk(chunk.chunk_offset)
            whole = len(zlib.decompressobj().decompress(packed, size + 1)) == size
        if not whole:
            raise ContentError(f"a chunk that should have {size} bytes has another size")


def _text(identifier: Any, name: bytes) -> str:
    attribute = _HDF5.h5a.open(identifier, name)
    kind, space = attribute.get_type(), attribute.get_space()
    if (
        kind.get_class() != _HDF5.h5t.STRING
        or kind.committed()
        or space.get_simple_extent_type() != _HDF5.h5s.SCALAR
        or attribute.get_storage_size() > MAX_BYTES
    ):
        raise ContentError(f"its attribute {name.decode(errors='replace')} is not a text")
    value = np.empty((), attribute.dtype)
    attribute.read(value)
    found = value.item()
    return found.decode() if isinstance(found, bytes) else str(found)
