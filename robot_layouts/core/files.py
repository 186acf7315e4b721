"""Reads files that someone else may have put in place: regular ones only, and never without end."""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Iterable
from os import PathLike
from typing import Any, BinaryIO

from robot_layouts.core.errors import UnreadableFileError
from robot_layouts.core.operating_system import READING

MAX_JSON_DEPTH = 64  # arrays and objects inside one another; a recording's json has 7
_BLOCK = 2**16  # bytes

_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a character device",
    stat.S_IFBLK: "a block device",
}


def open_regular(path: str | PathLike[str]) -> BinaryIO:
    """Open a regular file for reading; links are followed, and nothing else is ever waited for.

    Raises:
        UnreadableFileError: If there is none, it cannot be opened, or it is a directory, a FIFO,
            a socket or a device; its ``errno`` is that of the operating system.
    """
    try:
        _expect_regular(path, os.stat(path))  # opening a device may do something
        descriptor = os.open(path, READING)
        try:
            _expect_regular(path, os.fstat(descriptor))  # it may have been replaced meanwhile
            return os.fdopen(descriptor, "rb")
        except BaseException:
            os.close(descriptor)
            raise
    except UnreadableFileError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise _unreadable(path, error) from error


def read_regular(path: str | PathLike[str], limit: int) -> bytes:
    """Return the contents of a regular file.

    Args:
        path: The file.
        limit: The most bytes that it may have; not one more than that is read.

    Raises:
        UnreadableFileError: If it cannot be read, is no regular file, or is larger.
    """
    with open_regular(path) as file:
        try:
            contents = _read(file, limit)
        except OSError as error:
            raise _unreadable(path, error) from error
    if contents is None:
        raise UnreadableFileError(path, f"it has more than {limit:,} bytes", errno.EFBIG)
    return contents


def read_text(path: str | PathLike[str], limit: int) -> str:
    """Return the text of a regular file, which must be UTF-8; a byte order mark is left out.

    Raises:
        UnreadableFileError: If it cannot be read, is larger than ``limit`` bytes, or not UTF-8.
    """
    try:
        return read_regular(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableFileError(
            path, f"it is not UTF-8: {error.reason}, byte {error.start}"
        ) from error


def read_json(path: str | PathLike[str], limit: int) -> Any:
    """Return the value of a json file; see `parse_json`.

    Raises:
        UnreadableFileError: If it cannot be read, is larger than ``limit`` bytes, or not json.
    """
    try:
        return parse_json(read_text(path, limit))
    except ValueError as error:
        raise UnreadableFileError(path, str(error)) from error


def parse_json(text: str) -> Any:
    """Return the value of a json text that may come from anyone.

    Raises:
        ValueError: If it is not json, names a key twice in one object, has an integer of
            thousands of digits, or nests deeper than `MAX_JSON_DEPTH`.
    """
    too_deep = f"its json nests deeper than {MAX_JSON_DEPTH} levels"
    try:
        value = json.loads(text, object_pairs_hook=_unique)
    except RecursionError:
        raise ValueError(too_deep) from None
    except ValueError as error:
        raise ValueError(f"it is not json: {error}") from error
    level = [value] if isinstance(value, (dict, list)) else []
    for _ in range(MAX_JSON_DEPTH):
        level = [inner for outer in level for inner in _inside(outer)]
    if level:
        raise ValueError(too_deep)
    return value


def _inside(outer: Any) -> list[Any]:
    """Return the arrays and objects that are values of one."""
    values: Iterable[Any] = outer.values() if isinstance(outer, dict) else outer
    return [value for value in values if isinstance(value, (dict, list))]


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the key {next(n for n in names if names.count(n) > 1)!r} is there twice")
    return found


def _read(file: BinaryIO, limit: int) -> bytes | None:
    """Return all of a file, or None if it is larger; the size of some files is only known then."""
    size = os.fstat(file.fileno()).st_size
    contents = file.read(size) if size <= limit else b""
    while size <= limit and (more := file.read(min(_BLOCK, limit + 1 - size))):
        contents += more
        size += len(more)
    return contents if size <= limit else None


def _expect_regular(path: str | PathLike[str], status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise UnreadableFileError(path, f"it is {kind}, not a regular file", errno.EINVAL)


def _unreadable(path: str | PathLike[str], error: Exception) -> UnreadableFileError:
    reason = error.strerror if isinstance(error, OSError) else None
    return UnreadableFileError(path, reason or str(error), getattr(error, "errno", None))
