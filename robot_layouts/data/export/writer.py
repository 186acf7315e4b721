"""What the writers of datasets share: they complete what they wrote, or let go of it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

from robot_layouts.data.export.columns import ColumnReader, Columns
from robot_layouts.data.export.shots import Frame


class DatasetWriter(AbstractContextManager["DatasetWriter", None]):
    """Writes episodes one after the other; the dataset is complete when the block ends."""

    def __init__(self, folder: Path, reader: ColumnReader, origin: Mapping[str, Any]) -> None:
        """Begin a dataset.

        Args:
            folder: An empty folder.
            reader: Names the columns.
            origin: What is kept of where the episodes come from; anything that json can hold.
        """
        self._folder, self._reader, self._origin = folder, reader, origin

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
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
    def add(
        self,
        columns: Columns,
        frames: Iterable[Frame] = (),
        watch: Callable[[int], None] = lambda frame: None,
        *,
        text: str | None = None,
    ) -> None:
        """Write one episode.

        Args:
            columns: The episode, of T steps.
            frames: The pictures of T moments, or of T + 1 where the dataset holds what is seen
                after a step, too; none without channels.
            watch: Called with the number of moments whose pictures are written.
            text: What is to be done in it, in words; None: what the whole dataset says, if it does.

        Raises:
            OSError: If it cannot be written.
        """

    @abstractmethod
    def note(self, about: Mapping[str, Any]) -> None:
        """Keep more about where the last episode comes from: numbers, flags or texts by name."""

    @abstractmethod
    def _complete(self) -> None:
        """Write what can only be written when all episodes are known."""

    @abstractmethod
    def _let_go(self) -> None:
        """Close every file."""
