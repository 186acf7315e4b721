"""A line that tells how far a long comparison has come, on stderr."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import Progress, TaskID

PATIENCE = 2.0  # s without any word
PLAIN_INTERVAL = 10.0  # s between lines where stderr is no terminal


class LiveLine:
    """A progress bar after two seconds; where stderr is no terminal, a line every ten."""

    def __init__(self, total: int, unit: str = "steps") -> None:
        """Expect ``total`` steps, or what else ``unit`` names in the plural."""
        self._total, self._unit, self._done = total, unit, 0
        self._progress: Progress | None = None
        self._bar: TaskID | None = None

    def __enter__(self) -> LiveLine:
        """Start the clock."""
        self._started = time.monotonic()
        self._next_line = self._started + PATIENCE
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

    def advance(self, count: int, what: str) -> None:
        """Note ``count`` more units of ``what``."""
        self._done += count
        if self._progress is not None and self._bar is not None:
            self._progress.update(self._bar, completed=self._done, description=what)
        elif (now := time.monotonic()) >= self._next_line:
            self._next_line = now + PLAIN_INTERVAL
            self._show(what)

    def _show(self, what: str) -> None:
        if sys.stderr.isatty():
            self._progress = progress = Progress(console=Console(stderr=True), transient=True)
            progress.start()
            self._bar = progress.add_task(what, total=self._total, completed=self._done)
        else:
            done = f"{self._done} of {self._total} {self._unit}"
            print(f"{what}: {done} ({self._done / self._total:.0%})", file=sys.stderr, flush=True)
