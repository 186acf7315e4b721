"""An h5 file that another process reads, so that HDF5 crashes there, if it crashes.

One process reads the files of this one; it is started by the first of them, takes a fifth of a
second to start, and ends with this process.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import socket
import subprocess
import sys
import weakref
from collections import deque
from collections.abc import Collection, Mapping
from multiprocessing.connection import Connection
from os import PathLike
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.common.files import open_regular
from rollouts.reading.hdf5_reading import MAX_BYTES, ContentError

_BOOT = """
import sys
sys.path[:] = sys.argv[2:]
from rollouts.reading.hdf5_server import serve
serve(int(sys.argv[1]))
"""
_NO_PLUGINS = {"HDF5_PLUGIN_PRELOAD": "::"}  # HDF5 loads no code that files name

Shapes = dict[str, tuple[int, ...]]

_numbers = itertools.count()


class Hdf5File:
    """An h5 file that is open for reading; `ContentError` is raised where it cannot be read."""

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open a file; nothing but regular ones is opened.

        Raises:
            UnreadableFileError: If it is missing or no regular file.
            ContentError: If it is no h5 file.
        """
        open_regular(path).close()
        self._path, self._number = os.path.abspath(path), next(_numbers)
        self._abandon = weakref.finalize(self, _abandoned.append, self._number)
        self._abandon.atexit = False
        self._ask("texts", "", ())

    def __enter__(self) -> Hdf5File:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        if self._abandon.detach() is not None:
            _close(self._number)

    def members(self) -> list[str]:
        """Return the names of the groups and arrays directly in it."""
        return self._ask("members", "", None)

    def texts(self, group: str = "", names: Collection[str] | None = None) -> dict[str, str] | None:
        """Return attributes, which must be texts, of a group; None if there is no such group.

        Args:
            group: Its name; the file itself if empty.
            names: Which attributes; those that are not there are left out. All if None.
        """
        return self._ask("texts", group, names)

    def shapes(
        self, group: str, names: Collection[str] | None = None
    ) -> dict[str, tuple[int, ...]]:
        """Return the shapes of a group's arrays by names such as ``env_states/actors/cube``.

        Args:
            group: Its name.
            names: What to look at directly in this group; everything if None.
        """
        found: Mapping[str, list[int]] = self._ask("shapes", group, names)
        return {name: tuple(shape) for name, shape in found.items()}

    def numbers(self, group: str, names: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
        """Return a group's arrays; the arguments are those of `shapes`."""
        return self._ask("numbers", group, names)

    def _ask(self, wanted: str, group: str, names: Collection[str] | None) -> Any:
        if not self._abandon.alive:
            raise ContentError("it was closed")
        chosen = None if names is None else list(names)
        with _lock:
            return _reader().ask([self._number, self._path, wanted, group, chosen])


class _Reader:
    """The process that reads, as this one sees it."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _BOOT, str(theirs.fileno()), *sys.path],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **_NO_PLUGINS},
                start_new_session=True,  # Ctrl-C is for this process
            )
        self._connection = Connection(ours.detach())
        self._end = weakref.finalize(self, _end, self._process, self._connection, os.getpid())

    @property
    def alive(self) -> bool:
        """Whether it can be asked."""
        return self._end.alive

    def ask(self, request: list[Any]) -> Any:
        """Return the answer to a request; see `rollouts.reading.hdf5_server`.

        Raises:
            ContentError: If the file is not as it should be, or HDF5 died of it.
        """
        try:
            self._connection.send_bytes(json.dumps(request).encode())
            answer = json.loads(self._connection.recv_bytes())
            if "error" in answer:
                raise ContentError(answer["error"])
            value = answer["value"]
            return self._receive(value) if request[2] == "numbers" and value is not None else value
        except ContentError:
            raise
        except (EOFError, OSError) as error:
            self._end()
            raise ContentError(_death(self._process.returncode)) from error
        except BaseException:  # interrupted: half an answer is on its way
            self._end()
            raise

    def _receive(self, described: Mapping[str, tuple[list[int], str]]) -> dict[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = {}
        for name, (shape, dtype) in described.items():
            content = self._connection.recv_bytes(MAX_BYTES)
            if len(content) != math.prod(shape) * np.dtype(dtype).itemsize:
                raise EOFError
            arrays[name] = np.frombuffer(bytearray(content), dtype).reshape(shape)
        return arrays


_lock = Lock()
_readers: list[_Reader] = []  # at most one
_abandoned: deque[int] = deque()  # files that were not closed before they were forgotten


def _reader() -> _Reader:
    """Return the process that reads for this one, and start it if it is not there."""
    if not _readers or not _readers[0].alive:
        _readers[:] = [_Reader()]
    while _abandoned:
        _readers[0].ask([_abandoned.popleft(), "", "close", "", None])
    return _readers[0]


def _close(number: int) -> None:
    """Close a file, if the process that reads it has not ended."""
    with _lock:
        if _readers and _readers[0].alive:
            _readers[0].ask([number, "", "close", "", None])


def _forget() -> None:
    """Begin anew in a fork of this process, whose reader is not its own."""
    global _lock
    _lock = Lock()
    _readers.clear()
    _abandoned.clear()


os.register_at_fork(after_in_child=_forget)


def _end(process: subprocess.Popen[bytes], connection: Connection, owner: int) -> None:
    connection.close()
    if os.getpid() == owner:
        process.kill()
        process.wait()


def _death(code: int) -> str:
    if -code == signal.SIGXCPU:
        return "HDF5 does not come to an end reading it"
    return f"HDF5 crashed reading it (exit code {code})"
