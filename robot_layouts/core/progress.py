"""How far long work is, on stderr: nothing for two seconds, then a bar, or a line now and then."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from robot_layouts.core.commands import is_watched, notice

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

PATIENCE = 2.0  # s without any word
PLAIN_INTERVAL = 10.0  # s between lines where stderr is no terminal


class Progress:
    """Tells how far work is that takes longer than two seconds.

    Within a ``with`` statement it is a bar, where stderr is a terminal, and else a line every ten
    seconds; see `update`. What does not know its end says every two seconds what it does; see
    `tell`.

    Attributes:
        total: How many units there are to do; may be set as soon as it is known.
        told: How often `tell` was called.
    """

    def __init__(
        self,
        total: float = 1,
        unit: str = "steps",
        *,
        work: str = "",
        seconds: float = math.inf,
        late: Callable[[str], Exception] = TimeoutError,
    ) -> None:
        """Start the clock.

        Args:
            total: How many units there are to do.
            unit: What they are, in the plural.
            work: What is being done, for the lines of `tell`.
            seconds: How long the work may take (s).
            late: Makes what `tell` raises then, of what is being done.
        """
        self.total, self.told = total, 0
        self._unit, self._work, self._seconds, self._late = unit, work, seconds, late
        self._done = 0.0
        self._bar: tuple[Bar, TaskID] | None = None
        self._begun = time.monotonic()
        self._next_line = self._begun + PATIENCE

    def __enter__(self) -> Progress:
        """Begin here, if the work did not begin at once."""
        self._next_line = time.monotonic() + PATIENCE
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar[0].stop()

    def advance(self, count: float, what: str) -> None:
        """Note ``count`` more units of ``what``."""
        self.update(self._done + count, what)

    def update(self, done: float, what: str, total: float | None = None) -> None:
        """Note that ``done`` units are done, what is going on, and perhaps how many there are."""
        self._done, self.total = done, self.total if total is None else total
        if self._bar is not None:
            bar, task = self._bar
            bar.update(task, completed=done, total=self.total, description=what)
        elif (now := time.monotonic()) >= self._next_line:
            self._next_line = now + PLAIN_INTERVAL
            self._show(what)

    def tell(self, what: str) -> None:
        """Note what is going on.

        Raises:
            Exception: What ``late`` makes, if the work takes too long.
        """
        self.told += 1
        now = time.monotonic()
        if now - self._begun > self._seconds:
            raise self._late(what)
        if now >= self._next_line:
            self._next_line = now + PATIENCE
            notice(f"{self._work}: {what}")

    def say(self, text: str) -> None:
        """Print a line of its own, above the bar if there is one."""
        if self._bar is not None:
            self._bar[0].console.print(text, highlight=False, markup=False, soft_wrap=True)
        else:
            notice(text)

    def _show(self, what: str) -> None:
        if not is_watched():
            done = f"{self._done:.10g} of {self.total:.10g} {self._unit}"
            self.say(f"{what}: {done} ({self._done / self.total:.0%})")
            return
        from rich.console import Console
        from rich.progress import Progress as Bar

        bar = Bar(console=Console(stderr=True), transient=True)
        bar.start()
        self._bar = bar, bar.add_task(what, total=self.total, completed=self._done)  # pyright: ignore
