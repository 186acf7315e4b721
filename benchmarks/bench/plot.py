"""Measurements as one picture, a panel each: lines over numbers, bars over names."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

from benchmarks.bench.measurement import Measurement, number_text
from robot_layouts.core.figures import COLOURS, FAINT, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 2  # panels side by side
TITLE = 54  # characters of a line
DOTS_PER_INCH = 120
PANEL_WIDTH, PANEL_HEIGHT, BAR_HEIGHT, FOOT = 6.5, 3.6, 0.2, 0.7  # inches


def draw(measurements: Sequence[Measurement], footer: str) -> Figure:
    """Return a figure of measurements.

    Args:
        measurements: At least one.
        footer: What stands below: on what they were measured.

    Raises:
        MissingPackageError: If matplotlib is not installed.
    """
    in_rows = [measurements[i : i + COLUMNS] for i in range(0, len(measurements), COLUMNS)]
    columns = min(COLUMNS, len(measurements))
    heights = [max(map(_height, row)) for row in in_rows]
    size = PANEL_WIDTH * columns, sum(heights) + FOOT
    figure = blank_figure("a plot", size, DOTS_PER_INCH)
    figure.set_layout_engine("constrained")
    grid = figure.add_gridspec(len(in_rows), columns, height_ratios=heights)
    for i, row in enumerate(in_rows):
        for j, measurement in enumerate(row):
            _panel(figure.add_subplot(grid[i, j]), measurement)
    figure.supxlabel(fill(footer, 85 * columns), color=FAINT, fontsize=9, x=0.01, ha="left")
    return figure


def _height(measurement: Measurement) -> float:
    """Return how high a panel must be (inches)."""
    if not _has_names(measurement):
        return PANEL_HEIGHT
    bars = len(measurement.values) * (len(_shown(measurement)) + 0.7)
    return max(PANEL_HEIGHT * 0.75, 1.2 + BAR_HEIGHT * bars)


def _panel(axes: Axes, measurement: Measurement) -> None:
    axes.set_title(
        fill(measurement.title, TITLE), loc="left", color=INK, fontsize=11, fontweight="bold"
    )
    axes.tick_params(colors=INK, labelsize=9, length=0)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#BBBBBB")
    (_draw_bars if _has_names(measurement) else _draw_lines)(axes, measurement)
    if len(measurement.samples) > 1:
        axes.legend(fontsize=9, frameon=True, framealpha=0.9, edgecolor="#DDDDDD")


def _draw_lines(axes: Axes, measurement: Measurement) -> None:
    """Draw each series over the numbers, floors dashed, with what lies between the quartiles."""
    for series, colour in _colours(measurement).items():
        is_floor = series in measurement.floors
        points = [(v, m) for v in _numbers(measurement) if (m := measurement.median(series, v))]
        axes.plot(
            *zip(*points, strict=True),
            "--" if is_floor else "-",
            marker=None if is_floor else "o",
            color=colour,
            linewidth=1.6,
            markersize=5,
            label=series,
        )
        spread = [(v, *q) for v, _ in points if (q := measurement.quartiles(series, v))]
        if spread:
            at, low, high = zip(*spread, strict=True)
            axes.fill_between(at, low, high, color=colour, alpha=0.15, linewidth=0)
    numbers = _numbers(measurement)
    if max(numbers) >= 16 and all(number.bit_count() == 1 for number in numbers):  # 1, 2, 4 …
        axes.set_xscale("log", base=2)
    axes.set_xticks(numbers, [str(number) for number in numbers], minor=False)
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.set_xlabel(measurement.variable, color=INK)
    axes.set_ylabel(measurement.unit, color=INK)
    axes.grid(color="#DDDDDD", linewidth=0.6)


def _draw_bars(axes: Axes, measurement: Measurement) -> None:
    """Draw a bar for each series at each name, and floors as upright marks across them."""
    from matplotlib.patheffects import withStroke

    shown, colours = _shown(measurement), _colours(measurement)
    thickness = 0.8 / len(shown)
    for row, value in enumerate(measurement.values):
        for number, series in enumerate(shown):
            length = measurement.median(series, value)
            if length is None:
                continue
            y = row + (number - (len(shown) - 1) / 2) * thickness
            label = series if row == 0 else None
            axes.barh(y, length, thickness * 0.9, color=colours[series], label=label)
            low, high = measurement.quartiles(series, value) or (length, length)
            axes.plot([low, high], [y, y], color=INK, linewidth=1)
            axes.annotate(
                number_text(length),
                (max(length, high), y),
                (4, 0),
                textcoords="offset points",
                va="center",
                color=INK,
                fontsize=8,
                path_effects=[withStroke(linewidth=3, foreground="white")],
                zorder=5,
            )
        for series in measurement.floors:
            at = measurement.median(series, value)
            label = series if row == 0 else None
            if at is not None:
                axes.plot([at, at], [row - 0.45, row + 0.45], "--", color=INK, label=label)
    axes.set_yticks(range(len(measurement.values)), [str(v) for v in measurement.values])
    axes.set_ylim(len(measurement.values) - 0.45, -0.55)
    axes.margins(x=0.12)
    axes.set_xlim(left=0)
    axes.set_xlabel(measurement.unit, color=INK)
    axes.grid(axis="x", color="#DDDDDD", linewidth=0.6)


def _has_names(measurement: Measurement) -> bool:
    return not all(isinstance(value, int) for value in measurement.values)


def _numbers(measurement: Measurement) -> list[int]:
    return [value for value in measurement.values if isinstance(value, int)]


def _shown(measurement: Measurement) -> list[str]:
    """Return the series that are no floor."""
    return [series for series in measurement.samples if series not in measurement.floors]


def _colours(measurement: Measurement) -> dict[str, str]:
    """Return a colour for each series; a floor has that of what stands on it, unless it is one."""
    colours: dict[str, str] = dict(zip(_shown(measurement), COLOURS, strict=False))
    above = {floor: series for series, floor in measurement.ratios if series in colours}
    for floor in measurement.floors:
        alone = len(measurement.floors) == 1 or floor not in above
        colours[floor] = INK if alone else colours[above[floor]]
    return colours
