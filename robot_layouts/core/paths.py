"""Paths that people write, and the folder of the local copy of robot files."""

from __future__ import annotations

import os
from pathlib import Path

from robot_layouts.core.errors import AssetError

ROOT_VARIABLE = "ROBOT_LAYOUTS_ASSETS"
CHECKOUT_CACHE = Path(__file__).resolve().parents[2] / "assets_cache"


def absolute(path: str | os.PathLike[str], what: str) -> Path:
    """Return the absolute path of what a person wrote; ``~`` is the home directory.

    Args:
        path: What was written.
        what: What it is a path of, or the setting it was written to, for messages.

    Raises:
        AssetError: If it is empty, or in the home directory of a user that does not exist.
    """
    text = os.fspath(path)
    if not text:
        raise AssetError(f"{what} is empty; it takes a path")
    try:
        return Path(text).expanduser().absolute()
    except RuntimeError:
        user = text.split("/")[0]
        raise AssetError(
            f"{what} is {text!r}, but {user!r} has no home directory here; write the path out in"
            f" full, or ./{user} if it is called so"
        ) from None


def default_root() -> Path:
    """Return the folder of the local copy.

    ``ROBOT_LAYOUTS_ASSETS`` if it is set, else ``assets_cache/`` of a source checkout, else the
    user's cache directory.

    Raises:
        AssetError: If it is in the home directory of a user that does not exist.
    """
    chosen = os.environ.get(ROOT_VARIABLE)
    if chosen:
        return absolute(chosen, ROOT_VARIABLE)
    if (CHECKOUT_CACHE / "manifest.json").is_file():
        return CHECKOUT_CACHE
    from platformdirs import user_cache_path

    return user_cache_path("robot-layouts", appauthor=False)
