"""Paths that people write."""

from __future__ import annotations

import os
from pathlib import Path

from robots.common.errors import AssetError


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
