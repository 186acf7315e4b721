"""What a run of benchmarks leaves: a record, tables and a plot."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.bench.measurement import CORES, BenchmarkError, Measurement, Value, number_text
from benchmarks.bench.plot import draw
from benchmarks.records import DOCS, as_text, listed, render, table, versions_of
from robot_layouts.core.writing import write_whole, written_whole

RECORD = DOCS / "benchmarks.json"
PICTURE = DOCS / "images" / "benchmarks.png"
COMMAND = "make bench ARGS=--record"
PACKAGES = ("mani_skill", "sapien", "gymnasium", "torch", "numpy")  # that times depend on
SMALL = ("start", "memory", "recording", "validation")  # go into one table, a row each


@dataclass(frozen=True)
class Report:
    """What was measured in one run.

    Attributes:
        measurements: One per benchmark.
        machine: ``cpu``, ``cores``, ``system`` and ``versions``.
        clock: What times are, in words.
        load: Processes that wanted a core, on average over a minute, before and after.
        left_out: Benchmark → why it could not be run.
    """

    measurements: tuple[Measurement, ...]
    machine: Mapping[str, Any]
    clock: str
    load: tuple[float, ...]
    left_out: Mapping[str, str] = field(default_factory=dict[str, str])

    def find(self, name: str) -> Measurement:
        """Return a measurement by name.

        Raises:
            BenchmarkError: If there is none.
        """
        for measurement in self.measurements:
            if measurement.name == name:
                return measurement
        raise BenchmarkError(f"nothing was measured of {name!r}")

    def conditions(self) -> str:
        """Say on what it was measured, and how."""
        about = self.machine
        packages = listed({name: number for name, number in about["versions"].items() if number})
        load = " to ".join(f"{load:.1f}" for load in self.load)
        return (
            f"Medians on {about['cpu']} ({about['system']}), {about['cores']} cores, load average"
            f" {load}; {self.clock}; {packages}."
        )

    def with_those_of(self, other: Report, order: Sequence[str]) -> Report:
        """Return this report with what was measured in another run, and on what that was."""
        known = {one.name: one for one in self.measurements}
        said = other.conditions()
        known |= {one.name: replace(one, conditions=said) for one in other.measurements}
        return replace(self, measurements=tuple(known[name] for name in order if name in known))

    def as_json(self) -> str:
        """Return all of it as text in JSON."""
        found = {
            "machine": dict(self.machine),
            "clock": self.clock,
            "load": [round(load, 2) for load in self.load],
            "left_out": dict(self.left_out),
            "measurements": [measurement.as_json() for measurement in self.measurements],
        }
        return as_text(found)

    def print(self, console: Console) -> None:
        """Print all tables."""
        for measured in self.measurements:
            rows = Table(
                title=f"{measured.title} ({measured.unit})",
                title_justify="left",
                box=box.SIMPLE_HEAD,
                pad_edge=False,
            )
            for number, heading in enumerate(measured.headings()):
                rows.add_column(heading, justify="right" if number else "left", overflow="fold")
            for row in measured.rows():
                rows.add_row(*row)
            console.print(rows)
        console.print(self.conditions(), style="dim")

    def page(self) -> str:
        """Return the page of all benchmarks."""
        return render("benchmarks", report=self, picture=PICTURE.name)

    def draw(self, path: Path) -> None:
        """Write the plot into a PNG file.

        Raises:
            MissingPackageError: If there is no matplotlib.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        others = [f"{one.title}: {one.conditions}" for one in self.measurements if one.conditions]
        figure = draw(self.measurements, " ".join([self.conditions(), *others]))
        with written_whole(path) as unfinished:
            figure.savefig(unfinished, format="png")

    def write(self, folder: Path) -> None:
        """Write ``bench.json``, ``bench.md`` and ``bench.png`` into a folder.

        Raises:
            MissingPackageError: If there is no matplotlib for the plot; the rest is written.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        write_whole(folder / "bench.json", self.as_json())
        write_whole(folder / "bench.md", self.page())
        self.draw(folder / "bench.png")


def read_report(path: Path = RECORD) -> Report:
    """Return a report that was written.

    Raises:
        BenchmarkError: If it cannot be read.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        measurements = tuple(map(Measurement.from_json, found["measurements"]))
        load = tuple(found["load"])
        return Report(measurements, found["machine"], found["clock"], load, found["left_out"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise BenchmarkError(f"cannot read {path}: {error!r}; `{COMMAND}` writes it") from error


def machine() -> dict[str, Any]:
    """Return what times depend on, and nothing that tells whose machine it is."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    installed = versions_of(*PACKAGES)
    return {
        "cpu": models[0] if models else platform.processor() or "an unknown processor",
        "cores": CORES,
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {
            "python": platform.python_version(),
            **{package: installed.get(package) for package in PACKAGES},
        },
    }


def summary(report: Report) -> str:
    """Return the tables of ``docs/parity.md``: a row per task, the vectors, what is one number.

    Raises:
        BenchmarkError: If the report lacks something.
    """
    step, reset = report.find("step"), report.find("reset")
    if step.values != reset.values:
        raise BenchmarkError("step and reset were not measured on the same tasks")
    rows = zip(step.rows(), reset.rows(), strict=True)
    by_task = table(
        ["task", *_headings(step, "step"), *_headings(reset, "reset")],
        ([f"`{name}`", *cells, *others] for (name, *cells), (_, *others) in rows),
    )
    vector = report.find("vector")
    besides = ([f"{m.title} ({m.unit})", _values_text(m)] for m in map(report.find, SMALL))
    return "\n\n".join(
        [
            by_task,
            f"{vector.title}, {vector.unit}:",
            table(vector.headings(), vector.rows()),
            table(["besides", "median"], besides),
            report.conditions(),
        ]
    )


def _headings(measurement: Measurement, what: str) -> Iterator[str]:
    unit = measurement.unit.partition(" ")[0]
    yield from (f"{what}, {name} ({unit})" for name in measurement.samples)
    yield from measurement.headings()[1 + len(measurement.samples) :]


def _values_text(measured: Measurement) -> str:
    """Return the last series by value, and its ratios."""
    *_, last = measured.samples

    def text(value: Value) -> str:
        at = f"{value} {measured.variable}" if isinstance(value, int) else f"`{value}`"
        ratios = [f" ({a} / {b} {measured.ratio(a, b, value):.2f})" for a, b in measured.ratios]
        return f"{at}: {number_text(measured.median(last, value))}{''.join(ratios)}"

    return "; ".join(map(text, measured.values))
