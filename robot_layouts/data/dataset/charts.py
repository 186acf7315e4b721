"""Histograms as SVG, to be put into a page."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.pages import fragment

WIDTH, HEIGHT = 320, 132  # of a chart
_BASE = HEIGHT - 18  # y of the axis
_TOP = 14
MOST_BINS = 24


def histogram(
    values: NDArray[np.float64],
    failed: NDArray[np.bool_] | None,
    label: str,
    show: Callable[[float], str] = lambda value: f"{value:.4g}",
) -> str:
    """Return a histogram; bars of failed episodes stand on those of the others.

    Args:
        values: One for each episode, (n,) with n of 1 or more.
        failed: Whether it ended without success, (n,); None if nobody says.
        label: What is counted, in words.
        show: Writes a value at the axis.
    """
    failed = np.zeros(len(values), np.bool_) if failed is None else failed
    edges = _edges(values)
    good, bad = (np.histogram(values[chosen], edges)[0] for chosen in (~failed, failed))
    most = int((good + bad).max())
    counts = zip(good.tolist(), bad.tolist(), strict=True)
    bars = [
        bar
        for number, pair in enumerate(counts)
        for bar in _bars(number, edges, pair, (_BASE - _TOP) / most, show)
    ]
    low, high = float(values.min()), float(values.max())
    ends = [("start", 0, show(low)), ("end", WIDTH, show(high))][: 2 if high > low else 1]
    return fragment(
        "robot_layouts.data.dataset/histogram.svg.jinja",
        width=WIDTH,
        height=HEIGHT,
        base=_BASE,
        about=f"{label}: {len(values)} values from {show(low)} to {show(high)}",
        bars=bars,
        most=f"{most:,}",
        ends=ends,
    )


def _edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of bins, of whole numbers if these are few."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        return np.array([low - 0.5, high + 0.5])
    bins = min(MOST_BINS, 4 + round(len(values) ** 0.5))
    if (values == np.round(values)).all():
        step = max(1, math.ceil((high - low + 1) / bins))
        return np.arange(low - 0.5, high + step, step)
    return np.linspace(low, high, bins + 1)


def _bars(
    number: int,
    edges: NDArray[np.float64],
    counts: tuple[int, int],
    scale: float,
    show: Callable[[float], str],
) -> Iterator[dict[str, Any]]:
    """Yield the bars of one bin: that of successes, and on it that of failures."""
    width, y = WIDTH / (len(edges) - 1), float(_BASE)
    words = f"{show(edges[number])} to {show(edges[number + 1])}: {counts[0]:,} succeeded"
    words += f", {counts[1]:,} failed" if counts[1] else ""
    for count, kind in zip(counts, ("good", "bad"), strict=True):
        y -= count * scale
        if count:
            bar = {"kind": kind, "words": words, "x": number * width + 0.5, "y": y}
            yield {**bar, "width": max(width - 1, 0.5), "height": count * scale}
