"""``python -m measurements.imitation``: what the networks of the imitation examples have learned.

Reads the folders that `examples/imitate.py` and `examples/imitate_images.py` leave, whose results
are added to a record; a page and a picture of all learning curves are written beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from measurements.learned import Curve, Page, Seen, read_json, row, success, versions
from robots.common.commands import start

CURVE = "learning_curve.json"  # as the examples call it


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
    yield "processor of the same kind, so whoever learns again can verify them, and is told what"
    yield "has changed in the example since."


def _cells(run: Mapping[str, Any]) -> Iterator[str]:
    recipe, (first, last) = run["recipe"], run["test_seeds"]
    episodes = last - first + 1
    yield f"{recipe['episodes']:,}"
    yield f"{recipe['steps']:,} of {recipe['batch']}"
    yield str(episodes)
    yield success(run["failed"], episodes)
    yield ", ".join(map(str, run["failed"])) or "none"


def curve(name: str, run: Mapping[str, Any]) -> tuple[str, Curve]:
    """Return the name in the picture, and the curve, of a run."""
    label, steps = f"{name}: {100 * run['success']:.0f} at the end", run["recipe"]["steps"]
    return label, [(100 * p["steps"] / steps, 100 * p["success"]) for p in run["curve"]]


PAGE = Page(
    name="measurements.imitation",
    description=__doc__,
    record=Path("docs/imitation.json"),
    read=read,
    markdown=markdown,
    curve=curve,
    unit="batches learned from (% of the run)",
)

main = PAGE.main

if __name__ == "__main__":
    start(main)
