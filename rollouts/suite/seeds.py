"""Seeds as a suite's file writes them: ``0-99``, ``7``, or several of these in a list."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from robots import TaskError
from robots.common.bounds import shown
from rollouts.playing.seeds import checked_seeds
from rollouts.reading.manifest import spans_of

MOST = 100_000  # of a case; a receipt of as many episodes can still be read

_SPAN = re.compile(r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?")


def read_seeds(value: Any) -> tuple[int, ...]:
    """Return the seeds that a value names, smallest first.

    Args:
        value: A whole number, a text such as ``"0-99"`` or ``"0-9, 20"``, or a list of these.

    Raises:
        TaskError: If it names none, or one twice, or more than `MOST`.
    """
    parts = [part for one in _listed(value) for part in _parts(one)]
    spans = [_span(part, value) for part in parts]
    count = sum(map(len, spans))
    if not count:
        raise TaskError(f"seeds is {shown(value)}; one or more are needed, such as 0-99")
    if count > MOST:
        raise TaskError(f"seeds are {count:,}; {MOST:,} are most")
    return tuple(sorted(checked_seeds([seed for span in spans for seed in span])))


def write_seeds(seeds: Sequence[int]) -> str:
    """Return sorted seeds as the text that `read_seeds` reads."""
    spans = spans_of(seeds)
    return ", ".join(f"{a}-{b}" if b > a else str(a) for a, b in spans)


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple, range)) else [value]


def _parts(value: Any) -> list[str]:
    """Return the texts of single seeds and spans."""
    if isinstance(value, float) and value.is_integer():
        return [str(int(value))]  # as files hold whole numbers, too
    return [part.strip() for part in str(value).split(",")]


def _span(part: str, value: Any) -> range:
    match = _SPAN.fullmatch(part)
    if match is None:
        raise TaskError(f"seeds is {shown(value)}; it takes 0-99, 7, or a list of such")
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise TaskError(f"seeds {first}-{last} end before they begin; write {last}-{first}")
    return range(first, last + 1)
