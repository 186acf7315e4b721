"""Pairs of links that may overlap, written as groups."""

from __future__ import annotations

from itertools import combinations


def among(*groups: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return every pair of two links of the same group, each once.

    Args:
        groups: Link names; a link may be in several groups.
    """
    pairs = (pair for group in groups for pair in combinations(group, 2))
    return tuple({frozenset(pair): pair for pair in pairs}.values())
