"""``python -m measurements.reinforcement``: what two arms have learned of their rewards.

Reads the folders that `examples/ppo_two_arms.py` and `examples/mappo_two_arms.py` leave, with a
receipt of test episodes in each as ``receipt.json``; they are added to a record, and a page and a
picture of all learning curves are written beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from measurements.learned import Curve, Page, Seen, read_json, row, success, versions
from robots import RecordingError
from robots.common.commands import start
from rollouts.receipts import Receipt

ALGORITHMS = {"stable-baselines3": "PPO", "torchrl": "MAPPO"}  # by what a run's settings name


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
        "test_seeds": [episodes[0].seed, episodes[-1].seed],
        "failed": [episode.seed for episode in episodes if not episode.success],
    }


def markdown(seen: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# Reinforcement, measured"
    yield ""
    yield "What the [examples of reinforcement learning](tutorials/reinforcement.md) have learned"
    yield "of a task's dense reward. *Success* is that of test episodes without noise, of seeds"
    yield "that were not learned from, with 95 % confidence (Wilson's score interval)."
    yield "`python -m measurements.reinforcement RUN …` writes this page."
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
    last, (first_seed, last_seed) = run["curve"][-1], run["test_seeds"]
    episodes = last_seed - first_seed + 1
    yield run["with"]
    yield f"{last['steps']:,}" + ("" if last["steps"] >= run["steps"] else f" of {run['steps']:,}")
    yield f"{last['seconds'] / 3600:.1f}"
    yield str(episodes)
    yield success(run["failed"], episodes)
    yield ", ".join(map(str, run["failed"])) or "none"


def curve(name: str, run: Mapping[str, Any]) -> tuple[str, Curve]:
    """Return the name in the picture, and the curve, of a run."""
    return name, [(p["steps"] / 1e6, 100 * p["success"]) for p in run["curve"]]


PAGE = Page(
    name="measurements.reinforcement",
    description=__doc__,
    record=Path("docs/reinforcement.json"),
    read=read,
    markdown=markdown,
    curve=curve,
    unit="steps learned from (millions)",
)

main = PAGE.main

if __name__ == "__main__":
    start(main)
