"""Files that are written for a user to go on with, and never over what is there."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from robots.common.errors import UnwritableFileError


def write_new(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files that must not be there yet: all of them, or none.

    Args:
        folder: Where; it is made if need be.
        texts: Text by file name.

    Returns:
        Their paths.

    Raises:
        UnwritableFileError: If one is there already, or cannot be written.
    """
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            with (folder / name).open("x", encoding="utf-8") as file:
                written.append(folder / name)
                file.write(text)
    except OSError as error:
        for path in written:
            with suppress(OSError):
                path.unlink()
        if isinstance(error, FileExistsError):
            name = error.filename or folder
            words = f"{name} is there already, and is not overwritten; nothing was written"
            raise UnwritableFileError(words) from error
        raise UnwritableFileError(f"cannot write into {folder}: {error.strerror}") from error
    return written
