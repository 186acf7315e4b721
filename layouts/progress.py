"""How far a long look at a layout is, on stderr."""

from __future__ import annotations

import time

from robots.common.commands import notice

PATIENCE = 2.0  # s; what takes longer tells how far it is


class Progress:
    """Tells on stderr what is being looked at, once that takes longer than `PATIENCE`."""

    def __init__(self, work: str) -> None:
        """Begin some work.

        Args:
            work: What it is, for the lines.
        """
        self._work, self._told = work, time.monotonic()

    def tell(self, what: str) -> None:
        """Say what is being looked at now, unless something was said a moment ago."""
        now = time.monotonic()
        if now - self._told > PATIENCE:
            self._told = now
            notice(f"{self._work}: {what}")
