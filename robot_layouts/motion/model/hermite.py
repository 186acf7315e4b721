"""Smooth curves through knots: cubic between them, still beyond the ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robot_layouts.kinematics.rotations import Floats


def hermite(knots: Floats, values: Floats, slopes: Floats, times: ArrayLike) -> Floats:
    """Return values of the cubic curves through knots at some times, (…, n).

    Args:
        knots: Times of the knots, increasing, (T,) (s).
        values: There, (T, n).
        slopes: Derivatives there, (T, n) (per s).
        times: (…) (s); beyond the ends the values are those of the ends.
    """
    at, i, step = _places(knots, times)
    s = ((at - knots[i]) / step)[..., None]
    start, end = values[i], values[i + 1]
    leave, arrive = slopes[i] * step[..., None], slopes[i + 1] * step[..., None]
    rise = end - start
    # Horner's form around the start: exact at both ends for values that stay equal.
    bend = 3.0 * rise - 2.0 * leave - arrive
    twist = leave + arrive - 2.0 * rise
    return np.where(s < 1.0, start + s * (leave + s * (bend + s * twist)), end)


def hermite_slopes(knots: Floats, values: Floats, slopes: Floats, times: ArrayLike) -> Floats:
    """Return derivatives of the same curves, (…, n) (per s); 0 beyond the ends."""
    at, i, step = _places(knots, times)
    s = ((at - knots[i]) / step)[..., None]
    leave, arrive = slopes[i], slopes[i + 1]
    rise = (values[i + 1] - values[i]) / step[..., None]
    bend = 2.0 * (3.0 * rise - 2.0 * leave - arrive)
    twist = 3.0 * (leave + arrive - 2.0 * rise)
    inside = (np.asarray(times) >= knots[0]) & (np.asarray(times) <= knots[-1])
    within = np.where(s < 1.0, leave + s * (bend + s * twist), arrive)
    return np.where(inside[..., None], within, 0.0)


def hermite_extremes(knots: Floats, values: Floats, slopes: Floats) -> tuple[Floats, ...]:
    """Return where the same curves go farthest, and where they are fastest.

    Returns:
        Times (s), values there and derivatives there (per s), each (k, n): of all knots, and
        within each piece of every point at which a curve turns back or its slope does.
    """
    step = np.diff(knots)[:, None]
    rise, leave, arrive = np.diff(values, axis=0), slopes[:-1] * step, slopes[1:] * step
    bend, twist = 3.0 * rise - 2.0 * leave - arrive, leave + arrive - 2.0 * rise
    root = np.sqrt(np.maximum(bend * bend - 3.0 * twist * leave, 0.0))
    sum_ = -(bend + np.copysign(root, bend))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shares = np.stack([sum_ / (3.0 * twist), leave / sum_, -bend / (3.0 * twist)])
        s = np.clip(np.nan_to_num(shares, nan=0.0), 0.0, 1.0)
        inner = (leave + s * (2.0 * bend + 3.0 * s * twist)) / step
    found = (knots[:-1, None] + s * step, values[:-1] + s * (leave + s * (bend + s * twist)), inner)
    ends = (np.broadcast_to(knots[:, None], values.shape), values, slopes)
    return tuple(
        np.concatenate([at, more.reshape(-1, values.shape[1])])
        for at, more in zip(ends, found, strict=True)
    )


def _places(knots: Floats, times: ArrayLike) -> tuple[Floats, np.ndarray, Floats]:
    """Return times within the knots, the piece that each lies in, and how long that is (s)."""
    at = np.clip(np.asarray(times, float), knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    return at, i, knots[i + 1] - knots[i]
