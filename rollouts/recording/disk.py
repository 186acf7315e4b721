"""The only right to a folder, and what the disk refuses, in words."""

from __future__ import annotations

import fcntl
import os
from contextlib import AbstractContextManager, suppress
from pathlib import Path

from robots import RecordingError
from robots.common.writing import writing_errors


def disk_errors(path: Path) -> AbstractContextManager[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    return writing_errors(path, RecordingError, (OSError, RuntimeError, ValueError))


def claim(folder: Path, *, certain: bool = False) -> int | None:
    """Make a folder, unless it is there, and take the only right to it.

    Args:
        folder: The folder.
        certain: Whether not to take the right where the file system has no locks.

    Returns:
        An open descriptor that holds the right until it is closed, which the death of the process
        does too; None if another process has the right.
    """
    while True:
        folder.mkdir(exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError:
            if certain:
                os.close(descriptor)
                return None
            return descriptor
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), folder.stat()):
                return descriptor
        os.close(descriptor)  # its owner removed it meanwhile
