"""What a run of benchmarks leaves: json, tables and a plot."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from measurements.bench.measurement import BenchmarkError, Measurement
from measurements.bench.plot import draw
from measurements.bench.settings import CORES
from robots.common.writing import write_whole, written_whole

JSON, MARKDOWN, PLOT = "bench.json", "bench.md", "bench.png"
PACKAGES = ("mani_skill", "sapien", "gymnasium", "torch", "numpy")  # that times depend on


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
        packages = ", ".join(f"{name} {v}" for name, v in about["versions"].items() if v)
        load = " to ".join(f"{load:.1f}" for load in self.load)
        return (
            f"Medians on {about['cpu']} ({about['system']}), {about['cores']} cores, load average"
            f" {load}; {self.clock}; {packages}."
        )

    def as_json(self) -> str:
        """Return all of it as text in json."""
        found = {
            "machine": dict(self.machine),
            "clock": self.clock,
            "load": [round(load, 2) for load in self.load],
            "left_out": dict(self.left_out),
            "measurements": [measurement.as_json() for measurement in self.measurements],
        }
        return _samples_in_lines(json.dumps(found, indent=1, ensure_ascii=False)) + "\n"

    def markdown(self) -> Iterator[str]:
        """Yield the lines of a page with all tables."""
        yield "# Benchmarks"
        yield ""
        yield self.conditions()
        for measurement in self.measurements:
            yield ""
            yield f"## {measurement.title} ({measurement.unit})"
            yield ""
            yield from markdown_table(measurement.headings(), measurement.rows())

    def print(self, console: Console) -> None:
        """Print all tables."""
        for measurement in self.measurements:
            console.print(_table(measurement))
        console.print(self.conditions(), style="dim")

    def write(self, folder: Path) -> list[Path]:
        """Write json, tables and plot into a folder; returns which files were written.

        Raises:
            MissingPackageError: If there is no matplotlib for the plot; the rest is written.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        json_path, markdown_path, plot_path = (folder / name for name in (JSON, MARKDOWN, PLOT))
        for path, text in (
            (json_path, self.as_json()),
            (markdown_path, "\n".join(self.markdown()) + "\n"),
        ):
            write_whole(path, text)
        save(self, plot_path)
        return [json_path, markdown_path, plot_path]


def save(report: Report, path: Path) -> None:
    """Draw a report's plot into a file.

    Raises:
        MissingPackageError: If there is no matplotlib.
        UnwritableFileError: If it cannot be written (also an ``OSError``).
    """
    figure = draw(report.measurements, report.conditions())
    with written_whole(path) as unfinished:
        figure.savefig(unfinished, format="png")


def read(path: Path) -> Report:
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
        raise BenchmarkError(f"cannot read {path}: {error!r}") from error


def machine() -> dict[str, Any]:
    """Return what times depend on, and nothing that tells whose machine it is."""
    return {
        "cpu": _processor(),
        "cores": CORES,
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {"python": platform.python_version(), **{p: _version(p) for p in PACKAGES}},
    }


def markdown_table(headings: Sequence[str], rows: Iterator[list[str]]) -> Iterator[str]:
    """Yield the lines of a table whose first column is text and whose others are numbers."""
    yield f"| {' | '.join(headings)} |"
    yield f"| --- | {' | '.join(['---:'] * (len(headings) - 1))} |"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _table(measurement: Measurement) -> Table:
    table = Table(
        title=f"{measurement.title} ({measurement.unit})",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for number, heading in enumerate(measurement.headings()):
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    for row in measurement.rows():
        table.add_row(*row)
    return table


def _samples_in_lines(text: str) -> str:
    """Put what an innermost list holds on one line, so that a record can be read and compared."""
    lines: list[str] = []
    inside: list[str] | None = None
    for line in text.splitlines():
        if inside is None and line.endswith("["):
            inside = [line]
        elif inside is not None and line.endswith(("[", "{")):
            lines.extend(inside)
            inside = [line] if line.endswith("[") else None
            if inside is None:
                lines.append(line)
        elif inside is not None and line.strip().startswith("]"):
            lines.append(inside[0] + " ".join(x.strip() for x in inside[1:]) + line.strip())
            inside = None
        elif inside is not None:
            inside.append(line)
        else:
            lines.append(line)
    return "\n".join(lines)


def _processor() -> str:
    """Return the model of the processor as Linux tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or "an unknown processor"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
