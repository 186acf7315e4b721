"""Which episodes are asked for, and which of them failed."""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Iterable, Mapping

from robots import TaskError

_END = 2**32  # as in native
_SHOWN = 10  # seeds that a text names


def checked_seeds(seeds: Iterable[int]) -> list[int]:
    """Return seeds as plain integers.

    Raises:
        TaskError: If they are not seeds, or one is there twice.
    """
    try:
        checked = [operator.index(seed) for seed in seeds]
    except TypeError:
        raise TaskError(f"seeds is {seeds!r}; it takes a sequence of integers") from None
    outside = [seed for seed in checked if not 0 <= seed < _END]
    if outside:
        raise TaskError(f"seed {outside[0]} must lie from 0 to 2**32 - 1")
    twice = [seed for seed, count in Counter(checked).items() if count > 1]
    if twice:
        raise TaskError(f"seed {twice[0]} is there twice; each episode is played once")
    return checked


def seed_lines(what: str, reasons: Mapping[int, str]) -> list[str]:
    """Return lines that name seeds, and say why, one line for each seed of which that is known.

    Args:
        what: What is to be said of them, such as ``"no success"``.
        reasons: Seed → why, in words; empty if that is unknown.
    """
    if not reasons:
        return []
    more = f" and {len(reasons) - _SHOWN} more" if len(reasons) > _SHOWN else ""
    named = f"seed{'s' * (len(reasons) > 1)} {', '.join(map(str, [*reasons][:_SHOWN]))}{more}"
    known = [f"seed {seed}: {reason}" for seed, reason in reasons.items() if reason]
    return [f"{what}: {named}", *known[:_SHOWN]]
