"""Pages of what examples have learned: a record of runs, a page and a picture made of it."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from measurements.robots.record import versions_of
from robots import RecordingError
from robots.common.commands import exit_code
from robots.common.writing import write_whole
from rollouts.suite.results import wilson

PACKAGES = ("numpy", "torch", "sapien")  # whose versions are kept
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

Seen = dict[str, Any]
Curve = Sequence[tuple[float, float]]
"""Points: how far it had learned, and the success on unseen seeds (%)."""


@dataclass(frozen=True)
class Page:
    """How runs become a page.

    Attributes:
        name: Of the module that is run.
        description: What its command does.
        record: Where it is kept which runs there are; the page and the picture are beside it.
        read: Returns what a run is called, and what is kept of its folder.
        markdown: Yields the lines of the page of a record.
        curve: Returns the name in the picture, and the curve, of a run that is called so.
        unit: How far it has learned, in words with a unit.
    """

    name: str
    description: str | None
    record: Path
    read: Callable[[Path], tuple[str, Seen]]
    markdown: Callable[[Mapping[str, Any]], Iterator[str]]
    curve: Callable[[str, Mapping[str, Any]], tuple[str, Curve]]
    unit: str

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run the command.

        Returns:
            0 if everything was written, 1 if something cannot be read or written.
        """
        parser = argparse.ArgumentParser(
            prog=f"python -m {self.name}", description=self.description
        )
        add = parser.add_argument
        add("runs", nargs="*", type=Path, metavar="RUN", help="folder of a run to add")
        add("--out", type=Path, default=self.record, metavar="FILE", help="record (%(default)s)")
        options = parser.parse_args(arguments)
        return exit_code(lambda: self._run(options.runs, options.out))

    def _run(self, runs: Sequence[Path], out: Path) -> int:
        seen: Seen = read_json(out) if out.exists() else {"runs": {}}
        seen["runs"].update(map(self.read, runs))
        if runs:
            seen["versions"] = versions_of(*PACKAGES)
        seen["runs"] = dict(sorted(seen["runs"].items()))
        write_whole(out, json.dumps(seen, indent=1) + "\n")
        write_whole(out.with_suffix(".md"), "\n".join(self.markdown(seen)) + "\n")
        self._draw(seen["runs"], out.with_suffix(".png"))
        return 0

    def _draw(self, runs: Mapping[str, Any], path: Path) -> None:
        figure = Figure(figsize=(8, 4.5), dpi=110, layout="constrained")
        axes = figure.add_subplot(ylim=(-2, 102), xlabel=self.unit)
        axes.set_ylabel("success on unseen seeds (%)")
        for (name, run), colour in zip(runs.items(), cycle(COLOURS), strict=False):
            label, curve = self.curve(name, run)
            axes.plot(*zip(*curve, strict=True), "o-", color=colour, markersize=3, label=label)
        axes.grid(alpha=0.3)
        axes.legend(loc="lower right")
        figure.savefig(path)


def read_json(path: Path) -> Any:
    """Return what a file says.

    Raises:
        RecordingError: If it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def versions(seen: Mapping[str, Any]) -> str:
    """Return which versions a record is of, as a sentence."""
    return f"Learned with {', '.join(f'{name} {v}' for name, v in seen['versions'].items())}."


def success(failed: Sequence[int], episodes: int) -> str:
    """Return a rate of success with its interval (Wilson's), in percent."""
    low, high = wilson(episodes - len(failed), episodes)
    rate = 100 * (1 - len(failed) / episodes)
    return f"{rate:.0f} ({100 * low:.1f} to {100 * high:.1f})"


def row(*cells: str) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(cells)} |"
