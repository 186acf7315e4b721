"""What a fetch tells the person waiting for it, on stderr."""

from __future__ import annotations

from collections.abc import Sequence

from robot_layouts.core.commands import notice, printable


def say(text: str) -> None:
    """Print one line; no name in it steers the terminal."""
    notice(f"robot files: {printable(text)}")


def size(count: int) -> str:
    """Return a number of bytes as people write it."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"


def listing(entries: Sequence[str], separator: str = ", ", most: int = 12) -> str:
    """Return entries as a list for a message, and how many more there are beyond the first."""
    shown = list(entries[:most])
    if len(entries) > most:
        shown.append(f"and {len(entries) - most} more")
    return separator.join(shown)
