"""What several writers of recordings and data sets need of the disk."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, suppress
from io import FileIO
from pathlib import Path
from typing import Any

from robot_layouts.core.operating_system import lock, open_folder
from robot_layouts.core.writing import writing_errors
from robots import RecordingError


def disk_errors(path: Path) -> AbstractContextManager[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    return writing_errors(path, RecordingError, (OSError, RuntimeError, ValueError))


def claim(folder: Path, *, certain: bool = False) -> int | None:
    """Make a folder, unless it is there, and lock it; no file of the lock lies beside the user's.

    Args:
        folder: The folder.
        certain: Whether to return None where the file or the operating system has no locks.

    Returns:
        An open descriptor that holds the lock until it is closed, which the death of the process
        does too; None if another process holds it.
    """
    while True:
        with suppress(FileExistsError):
            folder.mkdir()
        try:
            descriptor = open_folder(folder)
        except FileNotFoundError:  # the process that held the lock has just removed the folder
            if folder.is_symlink():
                raise
            continue
        if descriptor is None:  # this system locks no folders
            return None if certain else os.open(os.devnull, os.O_RDONLY)
        try:
            lock(descriptor)
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
        os.close(descriptor)  # the folder was removed after it was opened


class DiskFile(FileIO):
    """A file for HDF5 to write to, which crashes the process where a disk refuses a write to it.

    HDF5 is given it as a file object. It keeps the first refusal of the disk for `refusals`, and
    then writes no more. It takes no memory, however large the file becomes.
    """

    _refusal: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write all of ``data``, unless the disk has refused something."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        with self._kept_refusal():
            while rest and self._refusal is None:
                rest = rest[super().write(rest) :]
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Change the size, unless the disk has refused something."""
        with self._kept_refusal():
            if self._refusal is None:
                super().truncate(size)
        return self.tell() if size is None else size

    @contextmanager
    def refusals(self) -> Generator[None]:
        """Raise at the end of the block what the disk refused; it explains whatever HDF5 says.

        Raises:
            OSError: If it did.
        """
        try:
            yield
        finally:
            if self._refusal is not None:
                raise self._refusal

    @contextmanager
    def _kept_refusal(self) -> Generator[None]:
        try:
            yield
        except OSError as refusal:
            self._refusal = refusal
