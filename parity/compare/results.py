"""The last recorded comparison of every task with native: ``parity/results.json``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from parity.compare.task_summary import Summary
from robots import RobotLayoutsError
from tasks.description import facts

RESULTS = Path(__file__).parents[1] / "results.json"


class ResultsError(RobotLayoutsError, ValueError):
    """A record of comparisons, or a page, that cannot be read."""


def record(found: Mapping[str, Any], summaries: Mapping[str, Summary]) -> str:
    """Return the record's text; makes each task once, to count its observation.

    Args:
        found: `parity.compare.printed.document` of the comparison.
        summaries: `parity.compare.task_summary.summarise` of it.
    """
    entries: dict[str, Any] = {}
    for task, summary in summaries.items():
        about = facts(task)
        entries[task] = {
            "robots": about.robots,
            "observation_size": about.observation_size,
            "action_size": about.action_size,
            **summary,
        }
    shared = {key: found[key] for key in ("equal", "versions", "machine")}
    return json.dumps({**shared, "tasks": entries}, indent=1, ensure_ascii=False) + "\n"


def read(path: Path = RESULTS) -> dict[str, Any]:
    """Return the record: ``equal``, ``versions``, ``machine`` and ``tasks``.

    Raises:
        ResultsError: If it cannot be read.
    """
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        missing = {"versions", "machine", "tasks"} - set(found)
    except (OSError, ValueError, TypeError) as error:
        raise ResultsError(f"cannot read {path}: {error}; `make parity` writes it") from error
    if missing:
        raise ResultsError(
            f"{path} has no {', '.join(sorted(missing))}; `make parity` writes it anew"
        )
    return found
