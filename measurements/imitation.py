"""``python -m measurements.imitation``: what the networks of the imitation examples have learned.

Reads the folders that `examples/imitate.py` and `examples/imitate_images.py` leave, whose results
are added to a record; a page and a picture of all learning curves are written beside it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from measurements.robots.record import versions_of
from robots import RecordingError
from robots.common.commands import exit_code, program, start
from robots.common.writing import write_whole
from rollouts.suite.statistics import wilson

RECORD = Path("docs/imitation.json")
CURVE = "learning_curve.json"  # as the examples call it
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

Seen = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if everything was written, 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog=program("measurements.imitation"), description=__doc__)
    add = parser.add_argument
    add("runs", nargs="*", type=Path, metavar="RUN", help="folder of a run to add")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    out: Path = options.out
    seen: Seen = _read(out) if out.exists() else {"runs": {}}
    for run in options.runs:
        found = _read(run / CURVE)
        seen["runs"][_name(found["recipe"])] = found
    if options.runs:
        seen["versions"] = versions_of("numpy", "torch", "sapien")
    seen["runs"] = dict(sorted(seen["runs"].items()))
    write_whole(out, json.dumps(seen, indent=1) + "\n")
    write_whole(out.with_suffix(".md"), "\n".join(markdown(seen)) + "\n")
    draw(seen, out.with_suffix(".png"))
    return 0


def _name(recipe: Mapping[str, Any]) -> str:
    """Return what a run is called: the task, and whether the network sees pictures."""
    return recipe["task"] + (", from pictures" if "size" in recipe else "")


def _read(path: Path) -> Seen:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def markdown(seen: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    versions = ", ".join(f"{name} {version}" for name, version in seen["versions"].items())
    yield "# Imitation, measured"
    yield ""
    yield "What the networks of `examples/imitate.py` and `examples/imitate_images.py` have learned"
    yield "of the experts' episodes; see [the tutorial](tutorials/imitation.md). *Success* is that"
    yield "of test seeds that they neither learned from nor were examined on, with 95 % confidence"
    yield "(Wilson's score interval). `python -m measurements.imitation RUN …` writes this page."
    yield f"Learned with {versions}."
    yield ""
    yield _row("task", "episodes", "batches", "test episodes", "success (%)", "failed seeds")
    yield _row("---", *["---:"] * 4, "---")
    for name, run in seen["runs"].items():
        yield _row(name, *_cells(run))
    yield ""
    yield "![Success on unseen seeds while they learn](imitation.png)"
    yield ""
    yield "Receipts of the test episodes, which name the weights by their checksums, are in"
    yield "`docs/receipts/imitation` of the repository; equal commands make equal weights on a"
    yield "processor of the same kind, so whoever learns again can verify them."


def _cells(run: Mapping[str, Any]) -> Iterator[str]:
    recipe, (first, last) = run["recipe"], run["test_seeds"]
    episodes = last - first + 1
    low, high = wilson(episodes - len(run["failed"]), episodes)
    yield f"{recipe['episodes']:,}"
    yield f"{recipe['steps']:,} of {recipe['batch']}"
    yield str(episodes)
    yield f"{100 * run['success']:.0f} ({100 * low:.1f} to {100 * high:.1f})"
    yield ", ".join(map(str, run["failed"])) or "none"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


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


if __name__ == "__main__":
    start(main)
