"""What the writers of datasets share: they complete what they wrote, or let go of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from types import TracebackType
from typing import TypeVar

_Writer = TypeVar("_Writer", bound="DatasetWriter")


class DatasetWriter(ABC):
    """Writes episodes one after the other; the dataset is complete when the block ends."""

    def __enter__(self: _Writer) -> _Writer:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the dataset, unless there was an error, and let go of its files."""
        if error is not None:
            with suppress(OSError):  # of files that are incomplete anyway: the first error counts
                self._let_go()
            return
        try:
            self._complete()
        finally:
            self._let_go()

    @abstractmethod
    def _complete(self) -> None:
        """Write what can only be written when all episodes are known."""

    @abstractmethod
    def _let_go(self) -> None:
        """Close every file."""
