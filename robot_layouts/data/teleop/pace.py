"""When the steps of an episode are due, so that it goes on in real time."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

MOST_BEHIND = 1.0  # s; what is later than that is not caught up: time goes slower instead
_WINDOW = 2.0  # s, over which the speed is measured


class Pace:
    """The clock of an episode: a step is never left out.

    Steps that are late are taken one right after the other until they have caught up. Where that
    would take too long the clock stands still meanwhile, which counts as lost.

    Attributes:
        lost: For how long the clock has stood still so far (s).
        speed: Of the episode, as a share of real time, over the last two seconds.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = monotonic) -> None:
        """Take the time between steps.

        Args:
            seconds: From one step to the next (s).
            clock: Returns the time (s).
        """
        self._seconds, self._clock = seconds, clock
        self.restart()

    def restart(self) -> None:
        """Let the next step be due now."""
        now = self._clock()
        self._due, self.lost, self.speed = now, 0.0, 1.0
        self._since, self._steps = now, 0

    def left(self) -> float:
        """Return the time until the next step is due (s); 0 or less: it is."""
        return self._due - self._clock()

    @property
    def behind(self) -> bool:
        """Whether more than one step is due."""
        return self.left() < -self._seconds

    def stepped(self) -> None:
        """Count a step that was taken."""
        now = self._clock()
        self._due += self._seconds
        if now - self._due > MOST_BEHIND:
            self.lost += now - self._due - MOST_BEHIND
            self._due = now - MOST_BEHIND
        self._steps += 1
        if now - self._since >= _WINDOW:
            self.speed = self._steps * self._seconds / (now - self._since)
            self._since, self._steps = now, 0
