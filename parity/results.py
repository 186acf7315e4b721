"""What comparisons found as plain data: of each run, of each task, and as it was last recorded."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from parity.lockstep import QUANTITIES, RunResult
from robots import RobotLayoutsError
from tasks.description import PARITY_RESULTS as RESULTS
from tasks.description import facts

PACKAGES = ("mani_skill", "sapien", "torch", "numpy")
REWARD = "reward"  # separated by mode, not with the other quantities
REWARD_MODES = ("normalized_dense", "dense", "sparse", "none")
WITHOUT_REWARD = tuple(quantity for quantity in QUANTITIES if quantity != REWARD)
COUNTS = ("episodes", "steps", "contact_steps")
NO_SUCH_MODE = "–"

Summary = dict[str, Any]


class ResultsError(RobotLayoutsError, ValueError):
    """A record of comparisons, or a page, that cannot be read."""


def document(results: Sequence[RunResult]) -> dict[str, Any]:
    """Return results as plain data for JSON; a difference that is no number is ``"inf"``."""
    return {
        "equal": all(result.equal for result in results),
        "versions": versions(),
        "machine": platform.machine(),
        "runs": [_run_document(result) for result in results],
    }


def _run_document(result: RunResult) -> dict[str, Any]:
    run = result.run
    return {
        "task": run.task,
        "source": run.source,
        "history": run.history,
        "reward_mode": run.reward_mode,
        "control_mode": run.control_mode,
        "num_envs": run.num_envs,
        "episodes": len(result.episodes),
        "steps": run.steps,
        "contact_steps": result.contact_steps,
        "equal": result.equal,
        "max_difference": {q: as_json(x) for q, x in result.max_difference.items()},
        "success": dict(zip(("native", "ours", "both"), result.successes, strict=True)),
        "differing": [
            {
                "seed": episode.seed,
                "step": first.step,
                "quantity": first.quantity,
                "entry": first.entry,
                "max_difference": {q: as_json(x) for q, x in episode.max_difference.items()},
            }
            for episode in result.episodes
            if (first := episode.first_difference) is not None
        ],
    }


def summarise(runs: Iterable[Mapping[str, Any]]) -> dict[str, Summary]:
    """Return what was found by task id, in the order of the runs.

    Args:
        runs: The ``"runs"`` of `document`.

    Returns:
        By task: ``equal``, ``episodes``, ``steps``, ``contact_steps``, ``success`` (episodes
        that succeeded in native, here, in both), ``histories``, ``actions`` (by source),
        ``max_difference`` by quantity and ``reward`` (max |Δ| by mode).
    """
    return {task: _summary(own) for task, own in _grouped(runs, "task").items()}


def _summary(runs: list[Mapping[str, Any]]) -> Summary:
    by_mode, by_source = _grouped(runs, "reward_mode"), _grouped(runs, "source")
    return {
        "equal": all(run["equal"] for run in runs),
        **_counts(runs),
        "success": {
            side: sum(run["success"][side] for run in runs) for side in ("native", "ours", "both")
        },
        "histories": list(_grouped(runs, "history")),
        "actions": {source: _counts(own) for source, own in by_source.items()},
        "max_difference": {q: _largest(runs, q) for q in WITHOUT_REWARD},
        REWARD: {mode: _largest(own, REWARD) for mode, own in by_mode.items()},
    }


def _grouped(runs: Iterable[Mapping[str, Any]], key: str) -> dict[str, list[Mapping[str, Any]]]:
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        groups.setdefault(run[key], []).append(run)
    return groups


def _counts(runs: list[Mapping[str, Any]]) -> dict[str, int]:
    return {key: sum(run[key] for run in runs) for key in COUNTS}


def _largest(runs: list[Mapping[str, Any]], quantity: str) -> float | str:
    return max((run["max_difference"][quantity] for run in runs), key=float)


def record_text(
    found: Mapping[str, Any], summaries: Mapping[str, Summary], others: Mapping[str, Any]
) -> str:
    """Return the record's text; makes each task once, to count its observation.

    Args:
        found: `document` of the comparison.
        summaries: `summarise` of it.
        others: What is kept of tasks that were not compared, by their ids.
    """
    entries = dict(others)
    for task, summary in summaries.items():
        about = facts(task)
        entries[task] = {
            "robots": about.robots,
            "observation_size": about.observation_size,
            "action_size": about.action_size,
            **summary,
        }
    shared = {key: found[key] for key in ("versions", "machine")}
    kept = {task: entries[task] for task in sorted(entries)}
    equal = all(entry["equal"] for entry in kept.values())
    record = {"equal": equal, **shared, "tasks": kept}
    return json.dumps(record, indent=1, ensure_ascii=False) + "\n"


def read_results(path: Path = RESULTS) -> dict[str, Any]:
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


def number_text(largest: float | str) -> str:
    """Return a max |Δ| in few characters: ``0`` only if it is exactly zero."""
    return "0" if largest == 0 else f"{float(largest):.1e}"


def reward_text(found: Mapping[str, Any], mode: str) -> str:
    """Return max |Δ| of the reward in one mode, or a dash if the task has no such mode."""
    return number_text(found[REWARD][mode]) if mode in found[REWARD] else NO_SUCH_MODE


def success_text(found: Mapping[str, Any]) -> str:
    """Return in how many episodes native and our side succeeded: ``3 / 3``."""
    return f"{found['success']['native']} / {found['success']['ours']}"


def as_json(value: float) -> float | str:
    """Return a difference as JSON has it, which has no infinity."""
    return value if math.isfinite(value) else "inf"


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of packages that results depend on; None if missing."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
