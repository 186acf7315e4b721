"""What a comparison tells its reader: a table, sentences, and a machine-readable document."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from parity.compare.runs import Run, RunResult
from parity.compare.snapshot import QUANTITIES

_PACKAGES = ("mani_skill", "sapien", "torch", "numpy")
_SHOWN_DIFFERENCES = 3  # of each run


def table(results: Sequence[RunResult]) -> Table:
    """Return max |Δ| by quantity, one row per run; what all runs share stands in the title."""
    shared, varying = _split_columns([result.run for result in results])
    title = "max |Δ| against native ManiSkill"
    rows = Table(
        title=f"{title} ({shared})" if shared else title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        collapse_padding=True,
    )
    rows.add_column("task", no_wrap=True)
    for name in varying:
        rows.add_column(name, overflow="fold", no_wrap=name != "actions")
    for name in ("episodes", "steps", "contact steps", *QUANTITIES):
        rows.add_column(name.replace(" ", "\n"), justify="right", no_wrap=True)
    for result in results:
        run, largest = result.run, result.max_difference
        rows.add_row(
            run.task,
            *(_columns(run)[name] for name in varying),
            *(str(n) for n in (len(result.episodes), run.steps, result.contact_steps)),
            *(_cell(largest[quantity]) for quantity in QUANTITIES),
        )
    return rows


def sentences(results: Sequence[RunResult]) -> list[str]:
    """Return where runs differ, then the verdict."""
    lines: list[str] = []
    for result in results:
        name = _name(result.run)
        for episode, first in result.differing[:_SHOWN_DIFFERENCES]:
            largest = max(episode.max_difference.values())
            lines.append(f"{name}: seed {episode.seed} differs {first}; max |Δ| {largest:.3g}")
        more = len(result.differing) - _SHOWN_DIFFERENCES
        if more > 0:
            lines.append(f"{name}: {more} more episode(s) differ")
    episodes = sum(len(result.episodes) for result in results)
    steps = sum(result.run.steps for result in results)
    native, ours, both = (sum(n) for n in zip(*(r.successes for r in results), strict=True))
    success = f"success in native {native}, here {ours}, both {both}"
    if all(result.equal for result in results):
        lines.append(f"Bitwise equal: {episodes} episodes, {steps} steps; {success}.")
    else:
        differing = sum(len(result.differing) for result in results)
        lines.append(f"NOT equal: {differing} of {episodes} episodes differ; {success}.")
    return lines


def document(results: Sequence[RunResult]) -> dict[str, Any]:
    """Return the results as plain data for JSON; a difference that is no number is ``"inf"``."""
    return {
        "equal": all(result.equal for result in results),
        "versions": versions(),
        "machine": platform.machine(),
        "runs": [_run_document(result) for result in results],
    }


def _run_document(result: RunResult) -> dict[str, Any]:
    run = result.run
    native, ours, both = result.successes
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
        "max_difference": {q: _number(x) for q, x in result.max_difference.items()},
        "success": {"native": native, "ours": ours, "both": both},
        "differing": [
            {
                "seed": episode.seed,
                "step": first.step,
                "quantity": first.quantity,
                "entry": first.entry,
                "max_difference": {q: _number(x) for q, x in episode.max_difference.items()},
            }
            for episode, first in result.differing
        ],
    }


def _name(run: Run) -> str:
    together = f", {run.num_envs} environments" if run.num_envs > 1 else ""
    return f"{run.task}, {run.source} actions, {run.history}, {run.reward_mode}{together}"


def _columns(run: Run) -> dict[str, str]:
    return {
        "actions": run.source,
        "history": run.history,
        "reward mode": run.reward_mode,
        "control mode": run.control_mode,
        "environments": str(run.num_envs),
    }


def _split_columns(runs: Sequence[Run]) -> tuple[str, list[str]]:
    values = {name: {_columns(run)[name] for run in runs} for name in _columns(runs[0])}
    shared = ", ".join(f"{name}: {min(v)}" for name, v in values.items() if len(v) == 1)
    return shared, [name for name, v in values.items() if len(v) > 1]


def _cell(largest: float) -> Text:
    return Text("0", style="green") if largest == 0 else Text(f"{largest:.1e}", style="bold red")


def _number(value: float) -> float | str:
    return value if math.isfinite(value) else "inf"


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of packages that results depend on; None if missing."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
