"""Files that are replaced in one step, and what the disk refuses, in words."""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from robots import RecordingError

PARTIAL = ".partial"


@contextmanager
def replaced(path: Path, label: str = "") -> Generator[Path]:
    """Give the name of a file to write, which takes the place of another when it is whole.

    Args:
        path: The file to replace, or to make.
        label: Tells several writers of one file apart.

    Raises:
        RecordingError: If the disk refuses; what was there stays, and nothing else is left.
    """
    partial = path.with_name(f"{path.name}{label}{PARTIAL}")
    with disk_errors(path):
        try:
            yield partial
            os.replace(partial, path)
        except BaseException:
            with suppress(OSError):
                partial.unlink()
            raise


@contextmanager
def disk_errors(path: Path) -> Generator[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    try:
        yield
    except RecordingError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"cannot write {path}: {_reason(error)}") from error


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


def write_text(path: Path, text: str) -> None:
    """Replace a text file in one step.

    Raises:
        RecordingError: If it cannot be written.
    """
    with replaced(path) as partial:
        partial.write_text(text)


def _reason(error: Exception) -> str:
    """Return what the operating system said, out of the page that HDF5 makes of it."""
    number = re.search(r"errno = (\d+)", str(error))
    if number is not None:
        return os.strerror(int(number[1]))
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
