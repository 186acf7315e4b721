"""Which episodes are asked for."""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Iterable

from robots import TaskError

_END = 2**32  # as in native


def checked_seeds(seeds: Iterable[int]) -> list[int]:
    """Return seeds as plain integers.

    Raises:
        TaskError: If they are none, or one is there twice.
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
