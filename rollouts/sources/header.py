"""What a recording says of its source as a whole, in ManiSkill's two fields."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

TYPE, DESCRIPTION = "source_type", "source_desc"
MIXED = "mixed"

_BETWEEN = "; "

Source = tuple[str | None, str | None]
"""``source_type`` and ``source_desc``."""


def source_of(header: Mapping[str, Any]) -> Source:
    """Return what a header says of its source."""
    return header.get(TYPE), header.get(DESCRIPTION)


def combined(sources: Iterable[Source]) -> dict[str, str | None]:
    """Return what the header of a recording says whose episodes are of these sources.

    It does not depend on their order.
    """
    found = set(sources)
    kinds = {kind for kind, _ in found}
    texts = {part for _, text in found for part in (text or "").split(_BETWEEN) if part}
    alone = len(kinds - {None}) <= 1 and len(texts) <= 1
    if alone:
        kind, text = next(iter(kinds - {None}), None), next(iter(texts), None)
        return {TYPE: kind, DESCRIPTION: text}
    return {TYPE: MIXED, DESCRIPTION: _BETWEEN.join(sorted(texts))}
