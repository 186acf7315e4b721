"""Histograms as SVG, to be put into a page."""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape

import numpy as np
from numpy.typing import NDArray

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
    bars = [
        bar
        for i, counts in enumerate(zip(good.tolist(), bad.tolist(), strict=True))
        for bar in _bars(i, len(edges) - 1, counts, most, (edges[i], edges[i + 1]), show)
    ]
    low, high = float(values.min()), float(values.max())
    about = f"{label}: {len(values)} values from {show(low)} to {show(high)}"
    ends = [("start", 0, low), ("end", WIDTH, high)] if high > low else [("start", 0, low)]
    texts = [
        f'<text x="{x}" y="{HEIGHT - 4}" text-anchor="{anchor}">{escape(show(value))}</text>'
        for anchor, x, value in ends
    ]
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(about)}">'
        f'<line x1="0" x2="{WIDTH}" y1="{_BASE}" y2="{_BASE}"/>{"".join(bars)}'
        f'<text x="0" y="10">{most:,}</text>{"".join(texts)}</svg>'
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
    place: int,
    count: int,
    counts: tuple[int, int],
    most: int,
    between: tuple[float, float],
    show: Callable[[float], str],
) -> list[str]:
    width, y, bars = WIDTH / count, float(_BASE), list[str]()
    words = f"{show(between[0])} to {show(between[1])}: {counts[0]:,} succeeded"
    words += f", {counts[1]:,} failed" if counts[1] else ""
    for number, kind in zip(counts, ("good", "bad"), strict=True):
        height = number / most * (_BASE - _TOP)
        y -= height
        if number:
            bars.append(
                f'<rect class="{kind}" x="{place * width + 0.5:.2f}" y="{y:.2f}"'
                f' width="{max(width - 1, 0.5):.2f}" height="{height:.2f}">'
                f"<title>{escape(words)}</title></rect>"
            )
    return bars
