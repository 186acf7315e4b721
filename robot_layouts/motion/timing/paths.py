"""Paths: straight lines between points of joint space, with rounded corners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robot_layouts.kinematics.rotations import Floats

SAME = 1e-9  # of joint coordinates (rad, m): nearer points are one


@dataclass(frozen=True, eq=False)
class Path:
    """A path through points; its parameter is the way, measured in the coordinate that is slowest.

    One unit of the parameter is as far as some coordinate gets in a second at full speed. Around
    an inner point with a blend b the path leaves the line b before it and joins the next line b
    behind it, on a curve whose first and second derivatives are continuous and which stays within
    the triangle of those three places.

    Attributes:
        points: (n, coordinates), n of 2 or more, each different from the one before (rad, m).
        blends: Of each point, (n,), none longer than half of a line beside it; 0 at both ends.
        speeds: Largest speed of each coordinate, (coordinates,) (rad/s, m/s).
    """

    points: Floats
    blends: Floats
    speeds: Floats

    @cached_property
    def lengths(self) -> Floats:
        """The length of each line in units of the parameter, (n - 1,)."""
        return way(self.points, self.speeds)

    @cached_property
    def corners(self) -> Floats:
        """The parameter of each point, (n,)."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @cached_property
    def directions(self) -> Floats:
        """The derivative on each line, (n - 1, coordinates)."""
        return np.diff(self.points, axis=0) / self.lengths[:, None]

    @property
    def length(self) -> float:
        """The parameter of the end."""
        return float(self.corners[-1])

    def at(self, parameters: Floats, order: int = 0) -> Floats:
        """Return places on the path, or derivatives by the parameter, (m, coordinates).

        Args:
            parameters: (m,), from 0 to `length`.
            order: 0 for places, 1 or 2 for derivatives.
        """
        s = np.asarray(parameters, float)
        line = np.clip(np.searchsorted(self.corners, s, side="right") - 1, 0, len(self.lengths) - 1)
        along = (s - self.corners[line])[:, None]
        direction = self.directions[line]
        lines = (self.points[line] + along * direction, direction, np.zeros_like(direction))
        return self._rounded(s, lines[order], order)

    def runs(self) -> list[Path]:
        """Return the path in pieces, cut at the inner points where it stops: those unblended."""
        stops = [0, *(np.flatnonzero(self.blends[1:-1] <= 0.0) + 1), len(self.points) - 1]
        return [
            Path(self.points[a : b + 1], self.blends[a : b + 1], self.speeds)
            for a, b in zip(stops[:-1], stops[1:], strict=True)
        ]

    def grid(self, pieces: int = 10, longest: float = 0.05) -> Floats:
        """Return parameters from 0 to the end that resolve the lines and the blends.

        Args:
            pieces: Of each blend, and at least of the path's first and last line.
            longest: The longest step.
        """
        marks = [0.0]
        for corner, blend in zip(self.corners[1:-1], self.blends[1:-1], strict=True):
            marks += [corner - blend, corner, corner + blend] if blend > 0 else [corner]
        marks = np.array([*marks, self.length])
        marks = marks[np.concatenate([[True], np.diff(marks) > SAME])]
        marks[-1] = self.length
        steps = np.maximum(np.ceil(np.diff(marks) / longest), pieces).astype(int)
        parts = [
            np.linspace(a, b, count, endpoint=False)
            for a, b, count in zip(marks[:-1], marks[1:], steps, strict=True)
        ]
        return np.concatenate([*parts, [self.length]])

    def _rounded(self, s: Floats, lines: Floats, order: int) -> Floats:
        for i in np.flatnonzero(self.blends > 0.0).tolist():
            half = float(self.blends[i])
            near = np.abs(s - self.corners[i]) < half
            if near.any():
                u = (s[near] - self.corners[i] + half)[:, None] / (2 * half)
                lines[near] = _blend(
                    u, self.points[i], self.directions[i - 1], self.directions[i], half, order
                )
        return lines


def _blend(
    u: Floats, corner: Floats, before: Floats, behind: Floats, half: float, order: int
) -> Floats:
    turn = behind - before
    if order == 2:
        return turn * (6 * u * (1 - u) / (2 * half))
    if order == 1:
        return before + turn * (u * u * (3 - 2 * u))
    return corner - half * before + 2 * half * (before * u + turn * (u**3 - u**4 / 2))


def way(points: Floats, speeds: Floats) -> Floats:
    """Return how long each line through points takes at full speed, (n - 1,) (s).

    Args:
        points: (n, coordinates) (rad, m).
        speeds: Largest speed of each coordinate, (coordinates,) (rad/s, m/s).
    """
    return (np.abs(np.diff(points, axis=0)) / speeds).max(axis=1)


def without_repeats(points: Floats) -> Floats:
    """Return points without those that equal the one before them; the last one stays."""
    moved = np.abs(np.diff(points, axis=0)).max(axis=1, initial=0.0) > SAME
    kept = points[np.concatenate([[True], moved])]
    kept[-1] = points[-1]
    return kept


def without_straight_points(points: Floats, speeds: Floats) -> Floats:
    """Return points without those at which a path does not turn."""
    points = without_repeats(points)
    if len(points) < 3:
        return points
    directions = np.diff(points, axis=0) / way(points, speeds)[:, None]
    turns = np.abs(np.diff(directions, axis=0)).max(axis=1) > 1e-6 * speeds.max()
    return points[np.concatenate([[True], turns, [True]])]
