"""The recorded benchmarks as the tables that docs/parity.md shows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from measurements.bench import report
from measurements.bench.measurement import BenchmarkError, Measurement, Value, number_text
from measurements.bench.report import Report, markdown_table
from parity.compare.results import ResultsError

RECORD = Path(__file__).parents[1] / "bench.json"
COMMAND = "make bench ARGS=--record"
PICTURE = Path(__file__).parents[2] / "docs" / "images" / "benchmarks.png"
SMALL = ("start", "memory", "recording", "validation")  # go into one table, a row each


def read(path: Path = RECORD) -> Report:
    """Return the recorded benchmarks.

    Raises:
        ResultsError: If they cannot be read.
    """
    try:
        return report.read(path)
    except BenchmarkError as error:
        raise ResultsError(f"{error}; `{COMMAND}` writes it") from error


def markdown(recorded: Report) -> Iterator[str]:
    """Yield the lines: one row per task, then the vectors, then what is one number."""
    step, reset = recorded.find("step"), recorded.find("reset")
    if step.values != reset.values:
        raise ValueError("step and reset were not measured on the same tasks")
    yield from markdown_table(
        ["task", *_headings(step, "step"), *_headings(reset, "reset")],
        (
            [f"`{name}`", *cells, *others]
            for (name, *cells), (_, *others) in zip(step.rows(), reset.rows(), strict=True)
        ),
    )
    vector = recorded.find("vector")
    yield ""
    yield f"{vector.title}, {vector.unit}:"
    yield ""
    yield from markdown_table(vector.headings(), vector.rows())
    yield ""
    yield from markdown_table(["besides", "median"], _small(recorded))
    yield ""
    yield recorded.conditions()


def page(recorded: Report) -> str:
    """Return the page of all benchmarks."""
    title, *lines = recorded.markdown()
    about = (
        "What things cost, beside the physics alone. `make bench ARGS=--record` measures all of it"
        " again, beside native\nManiSkill, and writes this page; `robot-layouts bench` needs no"
        " native. What the figures mean for tasks is told on\n[Parity and speed](parity.md#speed)."
    )
    picture = f"![All benchmarks, a panel each](images/{PICTURE.name})"
    return "\n".join([title, "", about, "", picture, *lines, ""])


def _headings(measurement: Measurement, what: str) -> list[str]:
    unit = measurement.unit.partition(" ")[0]
    series = [f"{what}, {name} ({unit})" for name in measurement.samples]
    return [*series, *measurement.headings()[1 + len(series) :]]


def _small(recorded: Report) -> Iterator[list[str]]:
    """Yield a row for each: the last series by value, and its ratios."""
    for name in SMALL:
        measurement = recorded.find(name)
        values = "; ".join(_value_text(measurement, value) for value in measurement.values)
        yield [f"{measurement.title} ({measurement.unit})", values]


def _value_text(measurement: Measurement, value: Value) -> str:
    last = [*measurement.samples][-1]
    at = f"{value} {measurement.variable}" if isinstance(value, int) else f"`{value}`"
    ratios = [
        f" ({' / '.join(pair)} {measurement.ratio(*pair, value):.2f})"
        for pair in measurement.ratios
    ]
    return f"{at}: {number_text(measurement.median(last, value))}{''.join(ratios)}"
