"""``python -m benchmarks imitation`` and ``reinforcement``: what examples have learned.

They read the folders that examples leave and add them to a record; a page and a picture of all
learning curves are written beside it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.records import (
    DOCS,
    Record,
    RecordError,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.suite.results import wilson

ALGORITHMS = {"stable-baselines3": "PPO", "torchrl": "MAPPO"}  # by what a run's settings name
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

Runs = Sequence[Path]
Curves = Mapping[str, Sequence[tuple[float, float]]]
"""By name the points of curves: how far it had learned, and the success on unseen seeds (%)."""


def imitation(runs: Runs = (), *, out: Path = DOCS / "imitation.json") -> int:
    """Write what the networks of examples/imitate.py and imitate_images.py have learned.

    Args:
        runs: Folders of runs to add.
        out: The record; page and picture are beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    added: Record = {}
    for run in runs:
        found = read_record(run / "learning_curve.json", recipe={}, test_seeds=[], curve=[])
        recipe = found["recipe"]
        added[recipe["task"] + (", from pictures" if "size" in recipe else "")] = found
    seen = _with_runs(out, added)
    rows = (
        (
            name,
            f"{run['recipe']['episodes']:,}",
            f"{run['recipe']['steps']:,} of {run['recipe']['batch']}",
            *_tested(run),
        )
        for name, run in seen["runs"].items()
    )
    columns = ("task", "episodes", "batches", "test episodes", "success (%)", "failed seeds")
    write_page(out, "imitation", versions=seen["versions"], table=table(columns, rows, range(1, 5)))
    curves = {
        f"{name}: {100 * run['success']:.0f} at the end": [
            (100 * point["steps"] / run["recipe"]["steps"], 100 * point["success"])
            for point in run["curve"]
        ]
        for name, run in seen["runs"].items()
    }
    _draw(curves, "batches learned from (% of the run)", out.with_suffix(".png"))
    return 0


def reinforcement(runs: Runs = (), *, out: Path = DOCS / "reinforcement.json") -> int:
    """Write what two arms have learned of their rewards, in examples/*ppo_two_arms.py.

    Args:
        runs: Folders of runs to add, with a receipt of test episodes in each as receipt.json.
        out: The record; page and picture are beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    seen = _with_runs(out, dict(map(_reinforced, runs)))
    rows: list[tuple[str, ...]] = []
    for name, run in seen["runs"].items():
        last = run["curve"][-1]
        more = "" if last["steps"] >= run["steps"] else f" of {run['steps']:,}"
        hours = f"{last['seconds'] / 3600:.1f}"
        rows.append((name, run["with"], f"{last['steps']:,}{more}", hours, *_tested(run)))
    columns = ("task", "with", "steps", "hours", "test episodes", "success (%)", "failed seeds")
    shown = table(columns, rows, range(2, 6))
    write_page(out, "reinforcement", versions=seen["versions"], table=shown)
    curves = {
        name: [(point["steps"] / 1e6, 100 * point["success"]) for point in run["curve"]]
        for name, run in seen["runs"].items()
    }
    _draw(curves, "steps learned from (millions)", out.with_suffix(".png"))
    return 0


def _reinforced(run: Path) -> tuple[str, Record]:
    """Return what a run is called, the task and the algorithm, and what is kept of it."""
    settings = read_record(run / "settings.json", task="", steps=0)
    library = next((name for name in ALGORITHMS if name in settings), None)
    checkpoints = sorted(run.glob("checkpoint-????"))
    if library is None or not checkpoints:
        raise RecordError(f"{run} holds no run of {' or '.join(ALGORITHMS.values())}")
    episodes = Receipt.read(run / "receipt.json").episodes
    return f"{settings['task']}, {ALGORITHMS[library]}", {
        "with": f"{library} {settings[library]}",
        "steps": settings["steps"],
        "curve": json.loads((checkpoints[-1] / "curve.json").read_text()),
        "test_seeds": [episodes[0].seed, episodes[-1].seed],
        "failed": [episode.seed for episode in episodes if not episode.success],
    }


def _with_runs(out: Path, added: Record) -> Record:
    """Return a record with runs added, as it is written."""
    seen = read_record(out, runs={}, versions={})
    if added:
        seen["runs"] = dict(sorted({**seen["runs"], **added}.items()))
        seen["versions"] = versions_of("numpy", "torch", "sapien")
        write_record(out, seen)
    return seen


def _tested(run: Mapping[str, Any]) -> tuple[str, str, str]:
    """Return test episodes, success with its interval (Wilson's, in percent), and failed seeds."""
    (first, last), failed = run["test_seeds"], run["failed"]
    episodes = last - first + 1
    low, high = wilson(episodes - len(failed), episodes)
    rate = 100 * (1 - len(failed) / episodes)
    success = f"{rate:.0f} ({100 * low:.1f} to {100 * high:.1f})"
    return str(episodes), success, ", ".join(map(str, failed)) or "none"


def _draw(curves: Curves, unit: str, path: Path) -> None:
    figure = Figure(figsize=(8, 4.5), dpi=110, layout="constrained")
    axes = figure.add_subplot(ylim=(-2, 102), xlabel=unit)
    axes.set_ylabel("success on unseen seeds (%)")
    for (label, curve), colour in zip(curves.items(), cycle(COLOURS), strict=False):
        axes.plot(*zip(*curve, strict=True), "o-", color=colour, markersize=3, label=label)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path)
