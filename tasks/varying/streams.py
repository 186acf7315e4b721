"""The random numbers of a randomization: each a function of what it is for.

They have no state. A number follows from the episode's seed, from how many resets without a seed
came since, and from the name of what it is drawn for: so another axis or another body never
changes what the others draw, and the task's own streams stay what they are. The words are those of
SHAKE-128, which are the same everywhere.
"""

from __future__ import annotations

import struct
from hashlib import shake_128
from typing import NamedTuple

_BITS = 53  # of a double


class Stream(NamedTuple):
    """Where an episode's random numbers come from.

    Attributes:
        seed: Seed of the episode.
        resets: How many resets without a seed came since the one that had it.
    """

    seed: int
    resets: int = 0

    def number(self, *names: str | int) -> float:
        """Return the number in (0, 1) that belongs to a name, such as ``"mass", "cube"``."""
        return self.numbers(1, *names)[0]

    def numbers(self, count: int, *names: str | int) -> list[float]:
        """Return several; the first ones are the same however many are asked for."""
        about = "\0".join(map(str, (self.seed, self.resets, *names)))
        words = struct.unpack(f"<{count}Q", shake_128(about.encode()).digest(8 * count))
        return [((word >> (64 - _BITS)) + 0.5) * 2.0**-_BITS for word in words]
