"""A file for HDF5 to write to, which crashes the process where a disk refuses a write to it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from io import FileIO
from typing import Any


class DiskFile(FileIO):
    """A file that keeps the first refusal of the disk for `refusals`, and then writes no more.

    HDF5 is given it as a file object. It takes no memory, however large the file becomes.
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
