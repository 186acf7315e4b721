"""``python -m measurements.imitation``: what the networks of the imitation examples have learned.

Reads the folders that `examples/imitate.py` and `examples/imitate_images.py` leave, whose results
are added to a record; a page and a picture of all learning curves are written beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from measurements.learned import Page, Seen, read_json, row, success, versions
from robots.common.commands import start

CURVE = "learning_curve.json"  # as the examples call it
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; see `measurements.learned.Page.main`."""
    return PAGE.main(__doc__, arguments)


def read(run: Path) -> tuple[str, Seen]:
    """Return what a run is called, the task and whether the network sees pictures, and its record.

    Raises:
        RecordingError: If it cannot be read.
    """
    found = read_json(run / CURVE)
    recipe = found["recipe"]
    return recipe["task"] + (", from pictures" if "size" in recipe else ""), found


def markdown(seen: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# Imitation, measured"
    yield ""
    yield "What the networks of `examples/imitate.py` and `examples/imitate_images.py` have learned"
    yield "of the experts' episodes; see [the tutorial](tutorials/imitation.md). *Success* is that"
    yield "of test seeds that they neither learned from nor were examined on, with 95 % confidence"
    yield "(Wilson's score interval). `python -m measurements.imitation RUN …` writes this page."
    yield versions(seen)
    yield ""
    yield row("task", "episodes", "batches", "test episodes", "success (%)", "failed seeds")
    yield row("---", *["---:"] * 4, "---")
    for name, run in seen["runs"].items():
        yield row(name, *_cells(run))
    yield ""
    yield "![Success on unseen seeds while they learn](imitation.png)"
    yield ""
    yield "Receipts of the test episodes, which name the weights by their checksums, are in"
    yield "`docs/receipts/imitation` of the repository; equal commands make equal weights on a"
    yield "processor of the same kind, so whoever learns again can verify them."


def _cells(run: Mapping[str, Any]) -> Iterator[str]:
    recipe, (first, last) = run["recipe"], run["test_seeds"]
    episodes = last - first + 1
    yield f"{recipe['episodes']:,}"
    yield f"{recipe['steps']:,} of {recipe['batch']}"
    yield str(episodes)
    yield success(run["failed"], episodes)
    yield ", ".join(map(str, run["failed"])) or "none"


def draw(seen: Mapping[str, Any], path: Path) -> None:
    """Save the learning curves as a picture: success beside the share of batches."""
    figure = Figure(figsize=(8, 4.5), dpi=110, layout="constrained")
    axes = figure.add_subplot(ylim=(-2, 102), xlim=(0, 100))
    axes.set_xlabel("batches learned from (% of the run)")
    axes.set_ylabel("success on unseen seeds (%)")
    for (name, run), colour in zip(seen["runs"].items(), cycle(COLOURS), strict=False):
        points = np.array([(point["steps"], point["success"]) for point in run["curve"]])
        share = 100 * points / (run["recipe"]["steps"], 1)
        label = f"{name}: {100 * run['success']:.0f} at the end"
        axes.plot(*share.T, "o-", color=colour, markersize=3, label=label)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.savefig(path)


PAGE = Page(
    name="measurements.imitation",
    record=Path("docs/imitation.json"),
    packages=("numpy", "torch", "sapien"),
    read=read,
    markdown=markdown,
    draw=draw,
)

if __name__ == "__main__":
    start(main)
