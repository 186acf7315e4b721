"""What a fetch tells the person waiting for it, on stderr."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

from robot_layouts.core.commands import is_watched, notice, printable

Advance = Callable[[int], None]


def say(text: str) -> None:
    """Print one line; no name in it steers the terminal."""
    notice(f"robot files: {printable(text)}")


@contextmanager
def download_bar(title: str, total: int | None) -> Generator[Advance]:
    """Show a bar while something is downloaded, if stderr is a terminal.

    Args:
        title: What is downloaded.
        total: Its size (bytes), or None if that is not known.

    Yields:
        A function to call with the number of bytes that arrived.
    """
    if not is_watched():
        yield lambda count: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns: list[ProgressColumn] = [
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
    ]
    if total is not None:
        columns.append(DownloadColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=total)
        yield lambda count: progress.advance(task, count)


def size(count: int) -> str:
    """Return a number of bytes as people write it."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"


def listing(entries: Sequence[str], separator: str = ", ", most: int = 12) -> str:
    """Return entries as a list for a message, and how many more there are beyond the first."""
    shown = list(entries[:most])
    if len(entries) > most:
        shown.append(f"and {len(entries) - most} more")
    return separator.join(shown)
