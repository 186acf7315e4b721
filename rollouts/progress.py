"""A line that tells how far long work is, on stderr."""

from __future__ import annotations

import time

from rich.console import Console
from rich.progress import Progress, TaskID

from robots.common.commands import is_watched, notice

PATIENCE = 2.0  # s without any word
PLAIN_INTERVAL = 10.0  # s between lines where stderr is no terminal


class LiveLine:
    """A progress bar after two seconds; where stderr is no terminal, a line every ten.

    Attributes:
        total: How many units there are to do; may be set as soon as it is known.
    """

    def __init__(self, total: float = 1, unit: str = "steps") -> None:
        """Expect ``total`` steps, or what else ``unit`` names in the plural."""
        self.total, self._unit, self._done = total, unit, 0.0
        self._progress: Progress | None = None
        self._bar: TaskID | None = None

    def __enter__(self) -> LiveLine:
        """Start the clock."""
        self._next_line = time.monotonic() + PATIENCE
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()

    def advance(self, count: float, what: str) -> None:
        """Note ``count`` more units of ``what``."""
        self.update(self._done + count, what)

    def update(self, done: float, what: str) -> None:
        """Note that ``done`` units are done, and what is going on."""
        self._done = done
        if self._progress is not None and self._bar is not None:
            self._progress.update(self._bar, completed=done, total=self.total, description=what)
        elif (now := time.monotonic()) >= self._next_line:
            self._next_line = now + PLAIN_INTERVAL
            self._show(what)

    def say(self, text: str) -> None:
        """Print a line of its own, above the bar if there is one."""
        if self._progress is not None:
            self._progress.console.print(text, highlight=False, markup=False, soft_wrap=True)
        else:
            notice(text)

    def _show(self, what: str) -> None:
        if is_watched():
            self._progress = progress = Progress(console=Console(stderr=True), transient=True)
            progress.start()
            self._bar = progress.add_task(what, total=self.total)
            progress.update(self._bar, completed=self._done)
        else:
            done = f"{self._done:.10g} of {self.total:.10g} {self._unit}"
            self.say(f"{what}: {done} ({self._done / self.total:.0%})")
