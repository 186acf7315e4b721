"""``python -m measurements.reinforcement``: what two arms have learned of their rewards.

Reads the folders that `examples/ppo_two_arms.py` and `examples/mappo_two_arms.py` leave, with a
receipt of test episodes in each as ``receipt.json``; they are added to a record, and a page and a
picture of all learning curves are written beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from measurements.learned import Page, Seen, read_json, row, success, versions
from robots import RecordingError
from robots.common.commands import start
from rollouts.receipts import Receipt

ALGORITHMS = {"stable-baselines3": "PPO", "torchrl": "MAPPO"}  # by what a run's settings name
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; see `measurements.learned.Page.main`."""
    return PAGE.main(__doc__, arguments)


def read(run: Path) -> tuple[str, Seen]:
    """Return what a run is called, the task and the algorithm, and its record.

    Raises:
        RecordingError: If it cannot be read.
        ReceiptError: If its receipt cannot be read.
    """
    settings = read_json(run / "settings.json")
    library = next((name for name in ALGORITHMS if name in settings), None)
    checkpoints = sorted(run.glob("checkpoint-????"))
    if library is None or not checkpoints:
        raise RecordingError(f"{run} holds no run of {' or '.join(ALGORITHMS.values())}")
    episodes = Receipt.read(run / "receipt.json").episodes
    return f"{settings['task']}, {ALGORITHMS[library]}", {
        "with": f"{library} {settings[library]}",
        "steps": settings["steps"],
        "curve": read_json(checkpoints[-1] / "curve.json"),
        "tested": [episodes[0].seed, episodes[-1].seed],
        "failed": [episode.seed for episode in episodes if not episode.success],
    }


def markdown(seen: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# Reinforcement, measured"
    yield ""
    yield "What `examples/ppo_two_arms.py` and `examples/mappo_two_arms.py` have learned of dense"
    yield "rewards; see [the tutorial](tutorials/reinforcement.md). *Success* is that of test"
    yield "episodes without noise, of seeds that were not learned from, with 95 % confidence"
    yield "(Wilson's score interval). `python -m measurements.reinforcement RUN …` writes this"
    yield "page."
    yield versions(seen)
    yield ""
    yield row("task", "with", "steps", "hours", "test episodes", "success (%)", "failed seeds")
    yield row("---", "---", *["---:"] * 4, "---")
    for name, run in seen["runs"].items():
        yield row(name, *_cells(run))
    yield ""
    yield "![Success on unseen seeds while they learn](reinforcement.png)"
    yield ""
    yield "Receipts of the test episodes are in `docs/receipts/reinforcement` of the repository;"
    yield "equal commands make equal weights on a processor of the same kind."


def _cells(run: Mapping[str, Any]) -> Iterator[str]:
    last, (first_seed, last_seed) = run["curve"][-1], run["tested"]
    episodes = last_seed - first_seed + 1
    yield run["with"]
    yield f"{last['steps']:,}" + ("" if last["steps"] >= run["steps"] else f" of {run['steps']:,}")
    yield f"{last['seconds'] / 3600:.1f}"
    yield str(episodes)
    yield success(run["failed"], episodes)
    yield ", ".join(map(str, run["failed"])) or "none"


def draw(seen: Mapping[str, Any], path: Path) -> None:
    """Save the learning curves as a picture: success beside the steps learned from."""
    figure = Figure(figsize=(8, 4.5), dpi=110, layout="constrained")
    axes = figure.add_subplot(ylim=(-2, 102))
    axes.set_xlabel("steps learned from (millions)")
    axes.set_ylabel("success on unseen seeds (%)")
    for (name, run), colour in zip(seen["runs"].items(), COLOURS, strict=False):
        points = np.array(
            [(point["steps"] / 1e6, 100 * point["success"]) for point in run["curve"]]
        )
        axes.plot(*points.T, "o-", color=colour, markersize=3, label=name)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path)


PAGE = Page(
    name="measurements.reinforcement",
    record=Path("docs/reinforcement.json"),
    packages=("numpy", "torch", "sapien"),
    read=read,
    markdown=markdown,
    draw=draw,
)

if __name__ == "__main__":
    start(main)
