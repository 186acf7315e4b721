"""What an episode of a recording consists of, and the checksum over it."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

CHECKSUM = "checksum"  # attribute of an episode's group in the h5 file
STATES = "env_states/"
ARRAYS = (
    "actions",
    STATES.rstrip("/"),
    "rewards",
    "success",
    "terminated",
    "truncated",
    "actor",
    "corrections",
)
TEXTS = ("action_split", "episode")


def checksum(attributes: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the checksum of an episode, whatever file it is in and in whatever order.

    It covers `TEXTS` and `ARRAYS`; what others may have added is left out.
    """
    names = sorted(name for name in arrays if name.partition("/")[0] in ARRAYS)
    about = [
        [(name, attributes.get(name)) for name in TEXTS],
        [(name, arrays[name].dtype.str, arrays[name].shape) for name in names],
    ]
    found = zlib.crc32(json.dumps(about).encode())
    for name in names:
        found = zlib.crc32(np.ascontiguousarray(arrays[name]).data, found)
    return f"crc32 {found:08x}"
