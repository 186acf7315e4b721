"""Names that are different from each other, in the letters that a format allows."""

from __future__ import annotations

import re
from itertools import count


class Names:
    """Gives out names, none of them twice, whatever the case of their letters."""

    def __init__(self, forbidden: str = r"[^\w.-]") -> None:
        """Give out names.

        Args:
            forbidden: Pattern of a character that no name may have; ``_`` takes its place.
        """
        self._forbidden = re.compile(forbidden, re.ASCII)
        self._taken: set[str] = set()

    def new(self, wanted: str) -> str:
        """Return a name that nobody has yet: the one wanted, or it with a number behind it."""
        plain = self._forbidden.sub("_", wanted)
        numbered = (plain if i == 1 else f"{plain}_{i}" for i in count(1))
        name = next(name for name in numbered if name.lower() not in self._taken)
        self._taken.add(name.lower())
        return name
