"""Reads h5 files that may come from anyone: plain arrays and texts inside the file, nothing else.

pyfive reads them, which is written in Python: a damaged file cannot crash it. An h5 file may still
name other files, declare arrays of any size, pack gigabytes into a few bytes, contain itself, or
lead a reader in circles. What is declared is therefore checked before it is read, and
`limited` ends what takes too long or too much memory.
"""

from __future__ import annotations

import ctypes
import math
import os
import posixpath
import threading
import zipfile
import zlib
from collections.abc import Callable, Collection, Generator, Iterator
from contextlib import contextmanager
from itertools import islice
from os import PathLike
from typing import Any, BinaryIO

import numpy as np
import pyfive
from numpy.typing import NDArray

from robot_layouts.core.files import open_regular
from robot_layouts.core.operating_system import read_at, resident_memory, thread_clock
from robots import RobotLayoutsError

MAX_BYTES = 2**30  # of one episode's arrays
MAX_ARRAYS = 10_000  # of one episode
MAX_DEPTH = 5  # groups of an episode inside one another: env_states/actors/cube is 2 deep
MAX_CHUNK = 2**26  # bytes of a chunk, unpacked; h5py itself makes chunks of at most 1 MiB
MAX_ATTRIBUTES = 100  # of one group

SECONDS = 5  # of processor time that something in a file may take
BYTES_PER_SECOND = 2e7  # that are read at least
MEMORY = 2**32  # bytes by which this process may grow meanwhile
_CHECK_EVERY = 0.05  # s
_MOST_READS = 100_000  # after which what pyfive keeps of a file is forgotten

_PYFIVE: Any = pyfive  # which has no complete types
_CHUNKED = 2  # HDF5's numbers of ways to store an array; more than that: in other files
_GZIP, _SHUFFLE, _CHECK = 1, 2, 3  # HDF5's numbers of filters
# In this order, as h5py applies them; each may be left out.
_PIPELINES = [
    [*shuffle, *pack, *check]
    for shuffle in ([], [_SHUFFLE])
    for pack in ([], [_GZIP])
    for check in ([], [_CHECK])
]
_END_PLACES = {0: 40, 2: 28, 3: 28}  # where the first block has the file's size, by its version
_CHECK_BYTES = 4  # that fletcher32 adds
_UNKNOWN = "something in it is damaged, or is not read, such as links to other files"
_FLAG = {"FALSE": 0, "TRUE": 1}  # the enumeration that h5py writes for bool

Shapes = dict[str, tuple[int, ...]]
NOTHING = np.zeros(0, bool)
_ERRORS = (
    *(OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError),
    *(MemoryError, EOFError, zlib.error, zipfile.BadZipFile),
)


class ContentError(ValueError):
    """Something in an h5 file that is not read; the message says what, without the file's name."""


class LimitError(ContentError):
    """An h5 file takes more time or memory than any of its size should."""

    def __init__(self) -> None:
        """Say so."""
        super().__init__("reading it takes more time or memory than any file of its size should")


class Hdf5File:
    """An h5 file that is open for reading; `ContentError` is raised where it cannot be read."""

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open a file; nothing but regular ones is opened.

        Raises:
            UnreadableFileError: If it is missing or no regular file.
            ContentError: If it is no h5 file.
        """
        self._stream, self._root = _Stream(open_regular(path)), None
        try:
            with self._reading() as root:
                self._members = sorted(root)
                self._stream.expect_end()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Hdf5File:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        self._stream.close()

    def members(self) -> list[str]:
        """Return the names of the groups and arrays directly in it."""
        return self._members

    def texts(self, group: str = "", names: Collection[str] | None = None) -> dict[str, str] | None:
        """Return attributes, which must be texts, of a group; None if there is no such group.

        Args:
            group: Its name; the file itself if empty.
            names: Which attributes; those that are not there are left out. All if None.
        """
        with self._reading() as root:
            found = self._group(root, group)
            if found is None:
                return None
            attributes = found.attrs
            if len(attributes) > MAX_ATTRIBUTES:
                raise ContentError(
                    f"it has {len(attributes):,} attributes, more than {MAX_ATTRIBUTES}"
                )
            wanted = attributes if names is None else [name for name in names if name in attributes]
            return {name: _text(name, attributes[name]) for name in wanted}

    def shapes(self, group: str, names: Collection[str] | None = None) -> Shapes:
        """Return the shapes of a group's arrays by names such as ``env_states/actors/cube``.

        Args:
            group: Its name.
            names: What to look at directly in this group; everything if None.
        """
        with self._reading() as root:
            found = self._arrays(root, group, names)
            return {name: array.shape for name, array in found.items() if array is not None}

    def numbers(
        self, group: str, names: Collection[str] | None = None, *, empty: bool = False
    ) -> dict[str, NDArray[Any]]:
        """Return a group's arrays.

        Args:
            group: See `shapes`.
            names: See `shapes`.
            empty: Whether to return empty groups, too: as no numbers, by a name that ends with a
                slash.
        """
        with self._reading(MAX_BYTES) as root:
            return {
                name: NOTHING if array is None else _read(array)
                for name, array in self._arrays(root, group, names).items()
                if empty or array is not None
            }

    @contextmanager
    def _reading(self, more: int = 0) -> Generator[Any]:
        """Give the file as pyfive sees it, with the time that it and ``more`` bytes may take."""
        if self._stream.closed:
            raise ContentError("it was closed")
        try:
            with limited(SECONDS + (self._stream.size + more) / BYTES_PER_SECOND):
                if self._root is None or self._stream.reads > _MOST_READS:
                    self._stream.reads = 0
                    self._root = _PYFIVE.File(self._stream)
                yield self._root
        except ContentError:
            raise
        except Exception as error:  # pyfive checks little: a damaged file raises errors of any kind
            raise ContentError(str(error) or _UNKNOWN) from error

    def _group(self, root: Any, name: str) -> Any:
        """Return a group in the file, or the file itself; None if there is nothing of the name."""
        if not name:
            return root
        found = _member(root, name) if name in self._members else None
        if isinstance(found, _PYFIVE.Dataset):
            raise ContentError(f"{name} is no group")
        return found

    def _arrays(self, root: Any, name: str, names: Collection[str] | None) -> dict[str, Any]:
        """Return the arrays in a group and in its groups; None in place of an empty group.

        Raises:
            ContentError: If something cannot be read safely, the groups nest too deep, or there
                is too much of it.
        """
        group = self._group(root, name)
        if group is None:
            return {}
        found = dict(islice(_walk(group, self._stream.size, names), MAX_ARRAYS + 1))
        if len(found) > MAX_ARRAYS:
            raise ContentError(f"it has more than {MAX_ARRAYS:,} arrays")
        if (size := sum(map(_bytes_of, found.values()))) > MAX_BYTES:
            raise ContentError(f"its arrays have {size:,} bytes, more than {MAX_BYTES:,}")
        return found


class _Stream:
    """The bytes of a file. It keeps its position itself, as forks of a process share the file's."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._position = file, 0
        self.size = os.fstat(file.fileno()).st_size
        self.reads = 0

    @property
    def closed(self) -> bool:
        return self._file.closed

    def close(self) -> None:
        self._file.close()

    def expect_end(self) -> None:
        """Refuse a file that is shorter than its first block says."""
        start = read_at(self._file, 64, 0)
        place = _END_PLACES.get(start[8]) if start.startswith(b"\x89HDF") else None
        if place is not None and int.from_bytes(start[place : place + 8], "little") > self.size:
            raise ContentError("its end is missing")

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._position = offset + (self.size if whence == os.SEEK_END else 0)
        return self._position

    def tell(self) -> int:
        return self._position

    def read(self, size: int = -1) -> bytes:
        rest = max(0, self.size - self._position)
        self.reads += 1
        count = rest if size < 0 else min(size, rest)
        found = read_at(self._file, count, self._position) if count else b""
        self._position += len(found)
        return found


@contextmanager
def limited(seconds: float) -> Generator[None]:
    """Interrupt a block of this thread that takes too long or too much memory.

    Python's own code is interrupted, between two steps of it, and not a call of a library in C.

    Args:
        seconds: Of processor time.

    Raises:
        LimitError: If it does.
    """
    thread, done = threading.get_ident(), threading.Event()
    clock = thread_clock()
    end, most = clock() + seconds, resident_memory() + MEMORY

    def watch() -> None:
        while not done.wait(_CHECK_EVERY):
            if clock() > end or resident_memory() > most:
                _interrupt(thread, LimitError)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _interrupt(thread: int, error: type[Exception]) -> None:
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))


def _member(group: Any, name: str) -> Any:
    """Return the group or array of a name that is in a group.

    Raises:
        ContentError: If it is a link to somewhere else, or a datatype.
    """
    found = group.get_lazy_view(name)
    if found is None or found.name != posixpath.join(group.name, name):
        raise ContentError(f"{name} is a link to somewhere else")
    if not isinstance(found, (_PYFIVE.Group, _PYFIVE.Dataset)):
        raise ContentError(f"{name} is neither a group nor an array")
    return found


def _walk(
    group: Any, file_size: int, names: Collection[str] | None, prefix: str = "", depth: int = 0
) -> Iterator[tuple[str, Any]]:
    if depth > MAX_DEPTH:
        raise ContentError(f"its groups are nested deeper than {MAX_DEPTH}")
    members = set(group)
    if len(members) > MAX_ARRAYS:
        raise ContentError(f"a group in it has more than {MAX_ARRAYS:,} members")
    for name in sorted(members) if names is None else [name for name in names if name in members]:
        found = _member(group, name)
        if isinstance(found, _PYFIVE.Group):
            if not len(found):
                yield f"{prefix}{name}/", None
            yield from _walk(found, file_size, None, f"{prefix}{name}/", depth + 1)
        else:
            _check(name, found, file_size)
            yield f"{prefix}{name}", found


def _check(name: str, array: Any, file_size: int) -> None:
    """Refuse an array whose numbers are not in the file, of an unusual kind, or too many."""
    stored, dtype, size = array.id, array.dtype, _bytes_of(array)
    if stored.layout_class > _CHUNKED:
        raise ContentError(f"{name} is a virtual array, whose numbers are in other files")
    if (filters := _filters(array)) not in _PIPELINES:
        raise ContentError(
            f"{name} is packed by HDF5 filters {filters}; only shuffle, gzip and fletcher32 are"
            f" read, {[_SHUFFLE, _GZIP, _CHECK]}, in this order"
        )
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        raise ContentError(f"{name} holds {dtype}, which is none of the usual kinds of numbers")
    if (meanings := _PYFIVE.check_enum_dtype(dtype)) not in (None, _FLAG):
        raise ContentError(f"{name} holds an enumeration, {meanings!r:.80}")
    if not array.shape:
        raise ContentError(f"{name} holds a single value, or none")
    if size > MAX_BYTES:
        raise ContentError(
            f"{name} declares shape {array.shape}, {size:,} bytes; at most {MAX_BYTES:,} are read"
        )
    whole = True
    if stored.layout_class == _CHUNKED and size:
        if math.prod(array.chunks) * dtype.itemsize > MAX_CHUNK:
            raise ContentError(
                f"{name} has chunks {array.chunks}; at most {MAX_CHUNK:,} bytes are read"
            )
        sides = [-(-side // step) for side, step in zip(array.shape, array.chunks, strict=True)]
        whole = math.prod(sides) == len(stored.index)
    elif stored.layout_class and size:
        whole = stored.data_offset + size <= file_size
    if not whole:
        raise ContentError(f"{name} declares shape {array.shape}, but not all of it is in the file")


def _bytes_of(array: Any) -> int:
    return 0 if array is None else math.prod(array.shape) * array.dtype.itemsize


def _filters(array: Any) -> list[int]:
    return [entry["filter_id"] for entry in array.id.filter_pipeline or []]


def _read(array: Any) -> NDArray[Any]:
    """Return the numbers of an array.

    Raises:
        ContentError: If a chunk of it unpacks to more than it declares, or a flag is not 0 or 1.
    """
    flags = _PYFIVE.check_enum_dtype(array.dtype) is not None
    if not _bytes_of(array):
        return np.empty(array.shape, bool if flags else array.dtype)
    if _filters(array):
        _check_chunks(array)
    if array.id.layout_class == 1:
        array.id.set_pseudo_chunk_size(0)  # read it at once
    rows = np.array(array[()], np.dtype(array.dtype.str))
    if not flags:
        return rows
    if (rows.view(np.uint8) > 1).any():
        raise ContentError("a flag is neither true nor false")
    return rows.astype(bool)


def _check_chunks(array: Any) -> None:
    """Refuse chunks that unpack to more than they should, which pyfive itself would do."""
    filters, size = _filters(array), math.prod(array.chunks) * array.dtype.itemsize
    for place, chunk in array.id.index.items():
        if _GZIP not in filters or chunk.filter_mask:
            whole = size <= chunk.size <= size + _CHECK_BYTES
        elif whole := chunk.size <= 2 * size + 1024:  # packing may make it larger
            packed = array.id.read_direct_chunk(place)[1]
            whole = len(zlib.decompressobj().decompress(packed, size + 1)) == size
        if not whole:
            raise ContentError(f"a chunk that should have {size} bytes has another size")


def _text(name: str, value: Any) -> str:
    if not isinstance(value, (bytes, str)):
        raise ContentError(f"its attribute {name} is not a text")
    return value.decode() if isinstance(value, bytes) else value


@contextmanager
def damage_errors(refusal: Callable[[str], RobotLayoutsError]) -> Generator[None]:
    """Turn what h5py, NumPy and others raise while they read a file into one of our errors.

    Args:
        refusal: Makes the error, given the reason.
    """
    try:
        yield
    except RobotLayoutsError:
        raise
    except _ERRORS as error:
        raise refusal(str(error) or repr(error)) from error
