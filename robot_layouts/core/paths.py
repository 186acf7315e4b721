"""Paths that people write, and the folder of the local copy of robot files.

To load the packages that read URDFs and meshes takes a third of the time in which a process makes
its first task. So what they read of files in the local copy is kept there as JSON.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from robot_layouts.core.errors import AssetError, UnreadableFileError, UnwritableFileError
from robot_layouts.core.files import read_regular
from robot_layouts.core.writing import write_whole

ROOT_VARIABLE = "ROBOT_LAYOUTS_ASSETS"
CHECKOUT_CACHE = Path(__file__).resolve().parents[2] / "assets_cache"
FOLDER = "parsed"  # in the local copy
_LARGEST = 2**22  # bytes


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


def cached(file: str, depends_on: Sequence[bytes], read: Callable[[], Any]) -> Any:
    """Return what reading a file comes to, from the cache if it was read before.

    Args:
        file: Its path. Nothing is cached of a file outside the local copy.
        depends_on: All that the result depends on, such as the reader's version and the contents.
        read: Reads the file; returns what JSON can hold, or arrays of numbers.

    Returns:
        What JSON makes of it, whether it was cached or not.

    Raises:
        Exception: What ``read`` raises, and nothing is cached then.
    """
    root = default_root()
    if not Path(file).is_relative_to(root):
        return json.loads(_written(read()))
    digests = b"".join(sha256(part).digest() for part in depends_on)
    entry = root / FOLDER / f"{sha256(digests).hexdigest()}.json"
    with suppress(UnreadableFileError):
        digest, _, text = read_regular(entry, _LARGEST).partition(b"\n")
        if sha256(text).hexdigest().encode() == digest:  # else it is damaged
            return json.loads(text)
    text = _written(read())
    with suppress(UnwritableFileError):
        write_whole(entry, sha256(text).hexdigest().encode() + b"\n" + text)
    return json.loads(text)


def _written(found: Any) -> bytes:
    return json.dumps(found, default=lambda array: array.tolist()).encode()
