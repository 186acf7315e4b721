"""How episodes end, read from what a task's ``evaluate()`` says: success, failure, neither.

Info may be arrays or tensors; what is returned is of the same kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SOLVED = "success"  # what `evaluate` calls it
FAILED = "fail"  # that the episode is lost; tasks need none
ELAPSED = "elapsed_steps"  # in info: control steps since the reset


def solved(info: Mapping[str, Any]) -> Any:
    """Return where the task is solved, (N,) bool: nowhere if it is open-ended."""
    return info[SOLVED] if SOLVED in info else info[ELAPSED] < 0


def ended(info: Mapping[str, Any]) -> Any:
    """Return where episodes end by themselves, solved or lost, (N,) bool, a new array."""
    return solved(info) | (info[FAILED] if FAILED in info else False)


def sparse(info: Mapping[str, Any]) -> Any:
    """Return 1 where the task is solved less 1 where it is lost, (N,), not floating yet."""
    return solved(info) * 1 - info[FAILED] * 1 if FAILED in info else solved(info) * 1
