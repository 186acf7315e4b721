"""The fastest speeds along a path, by two sweeps over it: what toppra does, for where it is not.

TOPP-RA (Pham and Pham, 2018) keeps of each point of the path the squared speeds from which its end
can still be reached, from the end to the start, and then goes as fast as these allow. In squares of
the speed x and accelerations u of the parameter, all limits are lines: A - B x at most, or C - D x
at least, for u. At rest nothing is asked for, so that all begin at x = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.timing.paths import Path

_FLAT = 1e-9  # slopes of coordinates that hardly move (s, as paths are measured)
_FAST = 1e6  # squared speed that no limit bounds


class _Lines(NamedTuple):
    """Bounds of u at each point: at most ``a - b x``, at least ``-a - b x``, and x at most."""

    a: Floats
    b: Floats
    fastest: Floats


def fastest_speeds(path: Path, grid: Floats, speeds: Floats, accelerations: Floats) -> Floats:
    """Return the largest speed of the parameter at each point, from rest to rest, (m,).

    Args:
        path: Without stops.
        grid: Parameters, (m,).
        speeds: Largest of each coordinate, (coordinates,) (rad/s, m/s).
        accelerations: Likewise (rad/s², m/s²).
    """
    steps = np.diff(grid)
    lines = _limits(steps, path.at(grid, 1), path.at(grid, 2), speeds, accelerations)
    reachable = np.zeros(len(grid))
    for i in reversed(range(len(steps))):
        reachable[i] = _largest(lines, i, steps[i], reachable[i + 1])
    squares = np.zeros(len(grid))
    for i, step in enumerate(steps):
        most = (lines.a[i] - lines.b[i] * squares[i]).min(initial=_FAST)
        squares[i + 1] = np.clip(squares[i] + 2 * step * most, 0.0, reachable[i + 1])
    return np.sqrt(squares)


def _limits(
    steps: Floats, slopes: Floats, bends: Floats, speeds: Floats, accelerations: Floats
) -> _Lines:
    """Return the limits of each step: of accelerations where it begins, and where it ends."""
    # Where it ends, x is x + 2 step u, which adds to what multiplies u.
    behind = slopes[1:] + 2 * steps[:, None] * bends[1:]
    moved = np.concatenate([slopes[:-1], behind], axis=1)
    turned = np.concatenate([bends[:-1], bends[1:]], axis=1)
    limit = np.tile(accelerations, 2)
    flat = np.abs(moved) < _FLAT
    scale = np.where(flat, 1.0, moved)
    with np.errstate(divide="ignore"):
        by_turning = np.where(flat & (turned != 0), limit / np.abs(turned), np.inf).min(axis=1)
        by_speed = (speeds / np.abs(slopes[:-1])).min(axis=1) ** 2
    return _Lines(
        np.where(flat, _FAST, limit / np.abs(scale)),
        np.where(flat, 0.0, turned / scale),
        np.minimum(np.minimum(by_turning, by_speed), _FAST),
    )


def _largest(lines: _Lines, i: int, step: float, behind: float) -> float:
    """Return the largest x of a point from which some u leads to between 0 and ``behind``."""
    onward = 1 / (2 * step)
    above = np.append(lines.a[i], behind * onward), np.append(lines.b[i], onward)
    below = np.append(-lines.a[i], 0.0), np.append(lines.b[i], onward)
    room = above[0][:, None] - below[0]
    faster = above[1][:, None] - below[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(faster > 0, room / faster, np.inf)
    return float(min(ends.min(), lines.fastest[i]))
