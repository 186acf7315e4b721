"""What operating systems have in ways of their own, or not at all; all of it can be called on any.

Linux has everything; each function says what happens where something is missing.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import BinaryIO

HAS_WORKERS = sys.platform == "linux"
"""Whether worker processes start here: they need Linux's sockets, memory and signals."""

READING = (
    os.O_RDONLY
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_NONBLOCK", 0)  # a FIFO is not waited for
    | getattr(os, "O_BINARY", 0)  # of Windows, where lines would end differently
)
"""How a file is opened of which nothing is known yet."""


def cores() -> int:
    """Return how many cores this process may use, or else how many this machine has."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def memory() -> int | None:
    """Return how much memory this machine has (bytes), or None where the system does not say."""
    configured = getattr(os, "sysconf", None)
    try:
        return configured and configured("SC_PHYS_PAGES") * configured("SC_PAGE_SIZE")
    except (OSError, ValueError):  # it knows no such name
        return None


def resident_memory() -> int:
    """Return how much memory this process takes (bytes); 0 where the system does not say."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    except OSError:
        return 0
    configured = getattr(os, "sysconf", None)
    return int(pages) * (configured("SC_PAGE_SIZE") if configured else 0)


def thread_clock() -> Callable[[], float]:
    """Return a clock of this thread's processor time (s), or else of the time that passes.

    Other threads may read it.
    """
    identify = getattr(time, "pthread_getcpuclockid", None)
    if identify is None:
        return time.monotonic
    return partial(getattr(time, "clock_gettime"), identify(threading.get_ident()))  # noqa: B009


def after_fork(do: Callable[[], None]) -> None:
    """Let something be done in every fork of this process, where there are forks."""
    register = getattr(os, "register_at_fork", None)
    if register is not None:
        register(after_in_child=do)


def read_at(file: BinaryIO, count: int, position: int) -> bytes:
    """Return bytes of a file.

    The position of the file stays, which forks of a process share, or else is moved.

    Args:
        file: It, open for reading.
        count: How many, fewer if it ends before.
        position: Where they begin.
    """
    read = getattr(os, "pread", None)
    if read is not None:
        return read(file.fileno(), count, position)
    file.seek(position)
    return file.read(count)


def open_folder(folder: Path) -> int | None:
    """Return a new descriptor of a folder that can be locked, or None where folders cannot be.

    Raises:
        OSError: If it cannot be opened.
    """
    only_folders = getattr(os, "O_DIRECTORY", None)
    if only_folders is None:
        return None
    return os.open(folder, os.O_RDONLY | only_folders)


def lock(descriptor: int) -> None:
    """Lock what `open_folder` returned, until the descriptor is closed.

    Raises:
        BlockingIOError: If another process has locked it.
        OSError: If its file system has no locks.
    """
    locks = import_module("fcntl")  # which Windows lacks
    locks.flock(descriptor, locks.LOCK_EX | locks.LOCK_NB)
