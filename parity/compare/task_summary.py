"""A comparison task by task: every run of a task together, as plain data and as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich import box
from rich.table import Table

from parity.compare.snapshot import QUANTITIES

REWARD = "reward"  # separated by mode, not with the other quantities
WITHOUT_REWARD = tuple(quantity for quantity in QUANTITIES if quantity != REWARD)
REWARD_MODES = ("normalized_dense", "dense", "sparse", "none")
NO_SUCH_MODE = "–"

Summary = dict[str, Any]


def summarise(runs: Iterable[Mapping[str, Any]]) -> dict[str, Summary]:
    """Return what was found by task id, in the order of the runs.

    Args:
        runs: The ``"runs"`` of `parity.compare.printed.document`.

    Returns:
        By task: ``equal``, ``episodes``, ``steps``, ``contact_steps``, ``success`` (episodes
        that succeeded in native, here, in both), ``histories``, ``actions`` (by source),
        ``max_difference`` by quantity and ``reward`` (max |Δ| by mode).
    """
    by_task: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        by_task.setdefault(run["task"], []).append(run)
    return {task: _summary(own) for task, own in by_task.items()}


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


def summary_table(summaries: Mapping[str, Summary]) -> Table:
    """Return one row per task: how much was played, max |Δ| of everything, and successes."""
    rows = Table(
        title="max |Δ| against native ManiSkill, all actions, histories and reward modes together",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        collapse_padding=True,
    )
    rows.add_column("task", no_wrap=True)
    counts = ("episodes", "steps", "contact_steps")
    modes = [f"{REWARD}_{mode}" for mode in REWARD_MODES]
    for name in (*counts, *WITHOUT_REWARD, *modes, "success native_/ here"):
        rows.add_column(name.replace("_", "\n").replace(" ", "\n"), justify="right", no_wrap=True)
    for task, found in summaries.items():
        rows.add_row(
            task,
            *(str(found[count]) for count in counts),
            *(number_text(found["max_difference"][q]) for q in WITHOUT_REWARD),
            *(reward_text(found, mode) for mode in REWARD_MODES),
            success_text(found),
        )
    return rows


def number_text(largest: float | str) -> str:
    """Return a max |Δ| in few characters: ``0`` only if it is exactly zero."""
    return "0" if largest == 0 else f"{float(largest):.1e}"


def reward_text(found: Mapping[str, Any], mode: str) -> str:
    """Return max |Δ| of the reward in one mode, or a dash if the task has no such mode."""
    return number_text(found[REWARD][mode]) if mode in found[REWARD] else NO_SUCH_MODE


def success_text(found: Mapping[str, Any]) -> str:
    """Return in how many episodes native and our side succeeded: ``3 / 3``."""
    return f"{found['success']['native']} / {found['success']['ours']}"


def _grouped(runs: list[Mapping[str, Any]], key: str) -> dict[str, list[Mapping[str, Any]]]:
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        groups.setdefault(run[key], []).append(run)
    return groups


def _counts(runs: list[Mapping[str, Any]]) -> dict[str, int]:
    return {key: sum(run[key] for run in runs) for key in ("episodes", "steps", "contact_steps")}


def _largest(runs: list[Mapping[str, Any]], quantity: str) -> float | str:
    return max((run["max_difference"][quantity] for run in runs), key=float)
