"""A bar that tells how far an export has come, on stderr."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import Progress

PATIENCE = 2.0  # s without any word
PLAIN_INTERVAL = 10.0  # s between lines where stderr is no terminal


class EpisodeBar:
    """A bar after two seconds; where stderr is no terminal, a line now and then."""

    def __init__(self, title: str) -> None:
        """Show nothing yet.

        Args:
            title: What is being done.
        """
        self._title, self._next = title, time.monotonic() + PATIENCE
        self._progress: Progress | None = None

    def __enter__(self) -> EpisodeBar:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()

    def update(self, done: float, total: int) -> None:
        """Note that ``done`` of ``total`` episodes are done."""
        if self._progress is not None:
            self._progress.update(self._progress.task_ids[0], completed=done)
        elif (now := time.monotonic()) >= self._next:
            self._next = now + PLAIN_INTERVAL
            self._show(done, total)

    def _show(self, done: float, total: int) -> None:
        if sys.stderr.isatty():
            self._progress = Progress(console=Console(stderr=True), transient=True)
            self._progress.start()
            self._progress.add_task(self._title, total=total)
            self.update(done, total)
        else:
            text = f"{self._title}: {done:.1f} of {total} episodes"
            print(text, file=sys.stderr, flush=True)
