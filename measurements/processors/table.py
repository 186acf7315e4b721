"""The record of processors as a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from measurements.processors.measure import summary
from measurements.processors.play import KINDS

_HEAD = """# What depends on the processor

The same episodes, of every task's expert and of random actions in three control modes, were played
in one process after the other: each under variables that make one library compute as on another
processor, or on a whole processor that QEMU emulates. The columns say in how many episodes any bit
of a kind differs from the same episodes played without them.
[Equal on every processor](howto/portable.md) says what follows from it.
"""


def markdown(record: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield from _HEAD.splitlines()
    yield "`python -m measurements.processors` measures it, and with `--settings` on emulated"
    versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    yield f"processors, too. The figures are of {versions} on an {record['processor']}."
    yield ""
    yield f"| computed as | which is | compared with | episodes | {' | '.join(KINDS)} |"
    yield "|---" * (4 + len(KINDS)) + "|"
    for name, seen in record["settings"].items():
        counts = " | ".join(map(str, summary(seen["different"]).values()))
        yield f"| {name} | {seen['about']} | {seen['against']} | {seen['episodes']} | {counts} |"
    yield from _physics(record["settings"])


def _physics(settings: Mapping[str, Any]) -> Iterator[str]:
    """Yield the episodes whose actions or states differ."""
    yield from ("", "## Episodes whose physics differs", "")
    for name, seen in settings.items():
        for episode, kinds in seen["different"].items():
            at = [f"{kind} from {kinds[kind]} on" for kind in KINDS[:2] if kind in kinds]
            if at:
                yield f"- {name}: {episode}: {', '.join(at)}"
