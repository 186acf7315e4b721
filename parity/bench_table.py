"""The recorded benchmarks as the tables that README.md shows."""

from __future__ import annotations

from collections.abc import Iterator

from rollouts.bench.measurement import Measurement, number_text
from rollouts.bench.report import Report, markdown_table

SMALL = ("start", "memory", "recording", "validation")  # go into one table, a row per value


def markdown(report: Report) -> Iterator[str]:
    """Yield the lines: one row per task, then the vectors, then what is told in one number."""
    step, reset = report.find("step"), report.find("reset")
    if step.values != reset.values:
        raise ValueError("step and reset were not measured on the same tasks")
    yield from markdown_table(
        ["task", *_headings(step, "step"), *_headings(reset, "reset")],
        (
            [f"`{name}`", *cells, *others]
            for (name, *cells), (_, *others) in zip(step.rows(), reset.rows(), strict=True)
        ),
    )
    vector = report.find("vector")
    yield ""
    yield f"{vector.title}, {vector.unit}:"
    yield ""
    yield from markdown_table(vector.headings(), vector.rows())
    yield ""
    yield from markdown_table(["what", "", "measured"], _small(report))
    yield ""
    yield report.told()


def _headings(measurement: Measurement, what: str) -> list[str]:
    unit = measurement.unit.partition(" ")[0]
    series = [f"{what}, {name} ({unit})" for name in measurement.samples]
    return [*series, *measurement.headings()[1 + len(series) :]]


def _small(report: Report) -> Iterator[list[str]]:
    """Yield a row for each value; the last series is what counts, or its ratio if it has one."""
    for name in SMALL:
        measurement = report.find(name)
        for value in measurement.values:
            told = f"{number_text(measurement.median([*measurement.samples][-1], value))}"
            told += f" {measurement.unit}"
            for pair in measurement.ratios:
                told += f", {' / '.join(pair)} {measurement.ratio(*pair, value):.2f}"
            yield [measurement.title, f"{value} {measurement.variable}", told]
