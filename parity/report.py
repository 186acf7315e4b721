"""``python -m parity report``: what a sweep found, as one HTML page that needs nothing else."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import jinja2

from parity.inventory import missing_tasks
from parity.lockstep import STATE
from parity.render import is_verified
from parity.results import (
    RESULTS,
    REWARD,
    ResultsError,
    number_text,
    read_results,
    success_text,
)
from parity.sweep import SUMMARY, read_summary
from robot_layouts.core.writing import write_whole
from robot_layouts.experts import list_experts
from robots import MissingPackageError
from tasks import get_task_class, list_clones
from tasks.description import read_docstring, robots_text

UNKNOWN = "–"


def report(
    *, runs: Path = Path("runs"), out: Path = Path("report.html"), results: Path = RESULTS
) -> int:
    """Write one HTML page on a sweep and the recorded comparison, with its clips inside.

    Args:
        runs: Folder of the sweep.
        out: The page.
        results: The record of comparisons.

    Raises:
        ResultsError: If there is no sweep or no record, or one cannot be read.
        UnwritableFileError: If the page cannot be written.
    """
    page = make_page(runs, results)
    write_whole(out, page)
    print(f"{out}: {len(page.encode()) / 1e6:.1f} MB")
    return 0


def make_page(runs: Path, results: Path = RESULTS) -> str:
    """Return the page.

    Args:
        runs: Folder of a sweep.
        results: The recorded comparison.

    Raises:
        ResultsError: If there is no sweep or no record, or one cannot be read.
    """
    if not (runs / SUMMARY).is_file():
        raise ResultsError(f"there is no {runs / SUMMARY}; `python -m parity sweep` writes it")
    swept, recorded = read_summary(runs / SUMMARY), read_results(results)
    ids = sorted({*list_clones(), *swept["tasks"]})
    shown = [
        _task(name, swept["tasks"].get(name), recorded["tasks"].get(name), runs) for name in ids
    ]
    try:
        missing: dict[str, str] | None = missing_tasks()
    except MissingPackageError:
        missing = None
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template("report.html.jinja").render(
        tasks=shown,
        recorded=recorded,
        swept=swept,
        verified=sum(task["verified"] for task in shown),
        replayed=[e["agreement"] for e in swept["tasks"].values() if e["agreement"]],
        missing=missing,
        no_expert=[name for name in ids if name not in list_experts()],
        date=datetime.now(timezone.utc).strftime("%-d %B %Y"),
        runs=shlex.quote(str(runs)),
    )


def _task(
    task_id: str, entry: Mapping[str, Any] | None, result: Mapping[str, Any] | None, runs: Path
) -> dict[str, Any]:
    """Return what the page says about a task.

    Args:
        task_id: The task.
        entry: Its entry in the sweep's summary, or None.
        result: Its recorded comparison, or None.
        runs: Folder of the sweep.
    """
    cls = get_task_class(task_id)
    clip = entry["clip"] if entry else None
    return {
        "id": task_id,
        "robots": robots_text(cls.layout),
        "about": read_docstring(cls),
        "entry": entry,
        "clip": clip,
        "video": _video(runs / task_id / clip["clip"]) if clip else None,
        "verified": is_verified(clip),
        "cells": [*_recorded_cells(result), *_swept_cells(entry)],
        "problems": list(_problems(entry)),
    }


def _video(path: Path) -> str:
    """Return a clip as an address that holds it.

    Raises:
        ResultsError: If it cannot be read.
    """
    try:
        return f"data:video/mp4;base64,{base64.b64encode(path.read_bytes()).decode()}"
    except OSError as error:
        raise ResultsError(f"{path} is gone; `python -m parity sweep --again` makes it") from error


def _recorded_cells(result: Mapping[str, Any] | None) -> list[str]:
    """Return episodes, steps, contact steps, max |Δ| of the state and the rest, successes."""
    if result is None:
        return [UNKNOWN] * 6
    largest, rewards = result["max_difference"], result[REWARD].values()
    rest = [*(largest[quantity] for quantity in ("observation", "info")), *rewards]
    return [
        *(f"{result[key]:,}" for key in ("episodes", "steps", "contact_steps")),
        number_text(max((largest[quantity] for quantity in STATE), key=float)),
        number_text(max(rest, key=float)),
        success_text(result),
    ]


def _swept_cells(entry: Mapping[str, Any] | None) -> list[str]:
    """Return source, equal episodes, successes, max |Δ| of all, frames that differ."""
    if entry is None:
        return [UNKNOWN] * 5
    agreement, rollout, clip = (entry[key] for key in ("agreement", "rollout", "clip"))
    both = [part["max_difference"] for part in (agreement, rollout) if part]
    return [
        entry["source"] or UNKNOWN,
        f"{agreement['equal']} / {agreement['episodes']}" if agreement else UNKNOWN,
        f"{agreement['native_success']} / {agreement['our_success']}" if agreement else UNKNOWN,
        number_text(max(both, key=float)) if both else UNKNOWN,
        f"{clip['differing_frames']} of {clip['frames']}" if clip else UNKNOWN,
    ]


def _problems(entry: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield what failed or differs in a task, a sentence each."""
    if entry is None:
        return
    if entry["error"]:
        yield f"The sweep of this task failed: {entry['error']}"
    for difference in (entry["agreement"] or {}).get("differing", ()):
        yield f"Seed {difference['seed']} differs {difference['where']}."
    rollout = entry["rollout"]
    if rollout and rollout["max_difference"] != 0:
        yield f"Arrays of the rollout differ by up to {number_text(rollout['max_difference'])}."
