"""What users gave, as messages quote it: no longer than a reader can take in."""

from __future__ import annotations

from collections.abc import Sequence
from reprlib import Repr
from typing import Any

MOST_CHARACTERS = 4000
"""Of a whole message; lists of all choices fit in."""

_END = 1000  # characters of a longer message that are kept of its end, where the advice is


def shown(value: Any) -> str:
    """Return what a user gave, as short as it has to be in a message, without addresses."""
    return _SHORT.repr(value)


def shortened(message: str) -> str:
    """Return a message without its middle if it is too long, whatever it quotes."""
    if len(message) <= MOST_CHARACTERS:
        return message
    return f"{message[: MOST_CHARACTERS - _END - 1]}…{message[-_END:]}"


def cut(text: str, length: int) -> str:
    """Return the beginning of a text that is too long, for a picture or a table."""
    return text if len(text) <= length else f"{text[: length - 1]}…"


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each row of a table, with columns of equal width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


class _Short(Repr):
    """Representations of some 80 characters."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = self.maxlong = 80

    def repr_str(self, x: str, level: int) -> str:
        kept = (self.maxstring - 3) // 2
        return repr(x if len(x) <= self.maxstring - 2 else f"{x[:kept]}…{x[-kept:]}")

    def repr_instance(self, x: Any, level: int) -> str:
        text = super().repr_instance(x, level)
        plain = type(x).__repr__ is object.__repr__ or text.startswith(
            f"<{type(x).__name__} instance"
        )
        return f"<{type(x).__name__}>" if plain else text


_SHORT = _Short()
