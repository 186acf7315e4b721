"""What ``summary.json`` says about the tasks of a sweep."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from parity.compare.printed import versions
from parity.compare.results import ResultsError
from parity.compare.task_summary import number_text
from parity.sweep.plan import Plan
from robots import RecordingError
from robots.common.writing import write_whole

SUMMARY = "summary.json"

Entry = dict[str, Any]  # what it says about one task


def read_summary(path: Path) -> dict[str, Any]:
    """Return a summary, empty if there is none yet.

    Raises:
        ResultsError: If it cannot be read.
    """
    if not path.exists():
        return {"tasks": {}}
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        for task_id, entry in found["tasks"].items():
            missing = [key for key in blank(task_id, {}) if key not in entry]
            if missing:
                raise ResultsError(
                    f"{path}: {task_id} has no {', '.join(missing)}; remove the file"
                )
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        if isinstance(error, ResultsError):
            raise
        raise ResultsError(
            f"{path} is no summary of a sweep ({error!r}); remove it, or give another --out"
        ) from error
    return found


def write_summary(path: Path, entries: Mapping[str, Entry]) -> None:
    """Write a summary; the file is always whole.

    Raises:
        RecordingError: If it cannot be written.
    """
    text = json.dumps(
        {
            "versions": versions(),
            "machine": platform.machine(),
            "tasks": dict(sorted(entries.items())),
        },
        indent=1,
        ensure_ascii=False,
    )
    write_whole(path, text + "\n", RecordingError)


def blank(task_id: str, options: Mapping[str, Any]) -> Entry:
    """Return the entry of a task about which nothing is known yet."""
    return {
        "task": task_id,
        "options": dict(options),
        "error": None,
        "equal": False,
        "source": None,
        "agreement": None,
        "rollout": None,
        "clip": None,
        "no_clip": None,
        "seconds": 0.0,
    }


def is_done(entry: Mapping[str, Any] | None, plan: Plan) -> bool:
    """Tell whether a summary's entry is of this very plan, and nothing in it failed."""
    return bool(entry) and entry["error"] is None and entry["options"] == plan.options  # type: ignore[index]


def line(entry: Mapping[str, Any]) -> str:
    """Return what was found about a task in one line."""
    parts = [f"{entry['task']:<22}"]
    if agreement := entry["agreement"]:
        parts.append(
            f"{agreement['equal']}/{agreement['episodes']} episodes equal"
            f" ({entry['source']}), success native {agreement['native_success']},"
            f" here {agreement['our_success']}"
        )
    if rollout := entry["rollout"]:
        parts.append(f"rollout max |Δ| {number_text(rollout['max_difference'])}")
    if clip := entry["clip"]:
        parts.append(f"clip: {clip['differing_frames']} of {clip['frames']} frames differ")
    if entry["error"]:
        parts.append(f"FAILED: {entry['error']}")
    return "  ".join(parts)
