"""Files that are written for a user to go on with, and never over what is there."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib.machinery import PathFinder
from keyword import iskeyword
from pathlib import Path

from robot_layouts.core.errors import RobotLayoutsError, UnwritableFileError
from robot_layouts.core.own_packages import PACKAGES


def check_module_name(module: str, better: str, error: type[RobotLayoutsError]) -> None:
    """Refuse to write a module that cannot be imported, or hides one that others import.

    Args:
        module: Its name.
        better: A name that the error proposes.
        error: Raised if so.
    """
    if iskeyword(module):
        what = "a keyword of Python"
    elif module in PACKAGES:
        what = "a package of this library"
    elif module in sys.stdlib_module_names:
        what = "a module of Python"
    elif _is_installed(module):
        what = "an installed module"
    else:
        return
    raise error(
        f"the file would be {module}.py, but {module!r} is {what}; choose another name, such as"
        f" {better}"
    )


def _is_installed(module: str) -> bool:
    here = os.path.realpath(os.curdir)  # whose own files are none of an installation
    elsewhere = [entry for entry in sys.path if os.path.realpath(entry) != here]
    return PathFinder.find_spec(module, elsewhere) is not None


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
