"""Folders that an export fills, and only then puts in the place of those of an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from robot_layouts.core.writing import written_whole
from robots import LayoutError

LICENCES = "LICENCES.md"  # a note on those of robot files


@contextmanager
def replaced_folder(folder: Path, is_own: Callable[[Path], bool], advice: str) -> Generator[Path]:
    """Give a folder to fill; at the end it takes the place of what an earlier export left.

    Args:
        folder: The folder to be.
        is_own: Tells of what lies in a folder of that name whether an export leaves such.
        advice: What to do if there is something else, for the message.

    Raises:
        LayoutError: If the folder holds something else, which would be lost.
        UnwritableFileError: If it cannot be written.
    """
    strange: list[str] = []
    with suppress(FileNotFoundError):  # none, or another export is just replacing it
        if folder.is_dir():
            strange = [found.name for found in sorted(folder.iterdir()) if not is_own(found)]
    if strange:
        raise LayoutError(
            f"{folder} would be replaced, but holds {', '.join(strange)}, which no export of a"
            f" layout leaves; move it, or {advice}"
        )
    with written_whole(folder, over=True) as made:
        made.mkdir(parents=True)
        yield made
