"""What reading a robot's file came to, cached for the next process.

To load the packages that read URDFs and meshes takes a third of the time in which a process makes
its first task. So what they read of files in the local copy is kept there as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from robot_layouts.core.errors import UnreadableFileError, UnwritableFileError
from robot_layouts.core.files import read_regular
from robot_layouts.core.paths import default_root
from robot_layouts.core.writing import write_whole

FOLDER = "parsed"  # in the local copy
_LARGEST = 2**22  # bytes


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
