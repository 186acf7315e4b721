"""A digest of all states of an episode, and how it stood at each moment."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from tasks.episode import States

BYTES = 2  # of the digest that are kept of each moment


@dataclass(frozen=True)
class StateTrace:
    """What identifies the states of an episode of T steps.

    Attributes:
        states: SHA-256, in hex, over all T + 1 states.
        trace: The first two bytes of that digest as it stood at each of these, in base64.
    """

    states: str
    trace: str


def trace_of(states: States) -> StateTrace:
    """Return the digest of an episode's states.

    It is over the names, types and sizes of the state dict's entries, sorted by name, and then
    over the bytes of these entries after the reset and after each step.

    Args:
        states: State dict of `TaskEnv.get_state_dict`, each entry (T + 1, k).
    """
    entries = {
        f"{kind}/{name}": rows
        for kind, by_name in sorted(states.items())
        for name, rows in sorted(by_name.items())
    }
    about = (f"{name} {rows.dtype.str} {rows.shape[1:]}\n" for name, rows in entries.items())
    digest = sha256("".join(about).encode())
    kept: list[bytes] = []
    for moment in np.concatenate([_bytes(rows) for rows in entries.values()], axis=1):
        digest.update(moment)
        kept.append(digest.digest()[:BYTES])
    return StateTrace(digest.hexdigest(), b64encode(b"".join(kept)).decode())


def _bytes(rows: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8)
