"""The record of experts as a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

Seen = Mapping[str, Any]


def markdown(record: Seen) -> Iterator[str]:
    """Yield the lines of the page."""
    versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    yield "# Experts of several robots"
    yield ""
    yield "How many episodes the experts solve, in their tasks' own layouts and in others, and in"
    yield "how many two arms touch; physics is looked at in every step. The other layouts are those"
    yield "that `layouts.search` returns for what the arms must reach, with several kinds of"
    yield "robots; for Relay, rings of three to six robots. `python -m measurements.experts`"
    yield f"measures it; the figures are of {versions}."
    yield ""
    yield "| task | layouts | episodes | solved | arms touch in | steps, median |"
    yield "|---|---|---|---|---|---|"
    for task_id, seen in sorted(record["tasks"].items()):
        yield _row(task_id, "its own", [*seen["own"].values()])
        others = [other for other in seen["others"].values() if "layout" in other]
        episodes = [episode for other in others for episode in other["episodes"].values()]
        yield _row(task_id, f"{len(others)} other{'s' * (len(others) != 1)}", episodes)
    yield from _failures(record)


def _row(task_id: str, layouts: str, episodes: Sequence[Seen]) -> str:
    solved = [episode for episode in episodes if episode["success"]]
    touching = sum(bool(episode["touching"]) for episode in episodes)
    rate = f"{len(solved)} ({100 * len(solved) / len(episodes):.0f} %)" if episodes else "–"
    steps = f"{median(episode['steps'] for episode in solved):.0f}" if solved else "–"
    return f"| {task_id} | {layouts} | {len(episodes)} | {rate} | {touching} | {steps} |"


def _failures(record: Seen) -> Iterator[str]:
    """Yield why episodes fail, by task and layout."""
    lines: list[str] = []
    for task_id, seen in sorted(record["tasks"].items()):
        where = {"its own layout": seen["own"]} | {
            f"layout {int(number) + 1}": other["episodes"]
            for number, other in seen["others"].items()
            if "layout" in other
        }
        for layout, episodes in where.items():
            reasons = Counter(e["reason"] for e in episodes.values() if not e["success"])
            lines += [f"- {task_id}, {layout}: {n} × {why}" for why, n in reasons.items()]
        for number, other in seen["others"].items():
            if "error" in other:
                lines.append(f"- {task_id}: no layout {int(number) + 1}: {other['error']}")
    if lines:
        yield from ("", "## What fails", "", *lines)
