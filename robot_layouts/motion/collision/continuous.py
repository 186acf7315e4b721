"""Whether anything collides along a curve: also between the moments that are checked.

Between two moments each coordinate goes no farther than the polygon of its piece's Bézier points
is long. That bounds how far every body travels, so that two bodies which are farther apart than
they can come nearer do not meet before the next moment; where they are not, moments are added.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import MotionError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.collision.travel import Intervals, TravelBounds
from robot_layouts.motion.model.bodies import Bodies
from robot_layouts.motion.model.hermite import hermite, hermite_slopes

CHUNK = 1024  # pieces that are checked together
MOST_CUTS = 64  # of a piece at once
MOST_MOMENTS = 10_000_000  # besides those between near bodies; that many take minutes
FINEST = 1e-5  # m; bodies that come nearer by no more than that between two moments are ignored
ROUNDING = 1e-5  # m; of distances that FCL finds by iteration
SPARSE = 0.02  # m; how far bodies travel between moments at which clearances are measured


@dataclass(frozen=True, eq=False)
class Curve:
    """All coordinates over time.

    Attributes:
        times: Of the knots, (T,) (s).
        positions: There, (T, D) (rad, m).
        velocities: There, (T, D) (rad/s, m/s).
    """

    times: Floats
    positions: Floats
    velocities: Floats

    def at(self, moments: Floats) -> Floats:
        """Return the coordinates at some times, (n, D) (rad, m)."""
        return hermite(self.times, self.positions, self.velocities, moments)

    def speeds(self, moments: Floats) -> Floats:
        """Return their velocities at some times, (n, D) (rad/s, m/s)."""
        return hermite_slopes(self.times, self.positions, self.velocities, moments)

    def ways(self, starts: Floats, ends: Floats) -> Intervals:
        """Return how far the coordinates go at most in pieces that have no knot inside.

        Args:
            starts: When the pieces begin, (n,) (s).
            ends: When they end, (n,) (s).
        """
        a, b = self.at(starts), self.at(ends)
        third = (ends - starts)[:, None] / 3
        points = np.stack([a, a + third * self.speeds(starts), b - third * self.speeds(ends), b])
        lengths = np.abs(np.diff(points, axis=0)).sum(axis=0)
        return Intervals(starts, ends, lengths, np.abs(points).max(axis=0))


class SeenAlong(NamedTuple):
    """What was seen along a curve.

    Attributes:
        moments: How many moments were checked.
        overlaps: Those at which bodies overlap, (k,) (s).
        sparse: Some of all, between which bodies travel about 2 cm, (m,) (s).
    """

    moments: int
    overlaps: Floats
    sparse: Floats


class CurveCheck:
    """A look for overlaps along all of a curve."""

    def __init__(
        self, cell: Bodies, checker: Checker, curve: Curve, step: float, turn: float
    ) -> None:
        """Prepare it.

        Args:
            cell: The cell.
            checker: What may not overlap.
            curve: Where all coordinates are.
            step: The farthest that any point may travel between two moments (m).
            turn: The farthest that any body may turn between two moments (rad).
        """
        self._checker, self._curve, self._step, self._turn = checker, curve, step, turn
        self._travel = TravelBounds(cell)
        self._parts = np.array([solid.part for solid in cell.solids], np.intp)

    def run(self) -> SeenAlong:
        """Return what is seen.

        Raises:
            MotionError: If it takes too many moments.
        """
        times = self._curve.times
        waiting = [(times, np.append(times[1:], times[-1]))]  # the last one is a moment
        self._expect_few(*waiting[0])
        moments, travelled = 0, 0.0
        overlaps, sparse = [np.zeros(0)], [times[:1]]
        while waiting:
            starts, ends = waiting.pop()
            if len(starts) > CHUNK:
                waiting.append((starts[CHUNK:], ends[CHUNK:]))
            ways = self._curve.ways(starts[:CHUNK], ends[:CHUNK])
            moved, pieces = self._bounds(ways)
            if (pieces > 1).any():
                cuts = np.clip(np.ceil(1.1 * pieces), 2, MOST_CUTS)
                waiting.append(_cut(ways, np.where(pieces > 1, cuts, 1)))
                continue
            overlapping, open_ = self._look_at(ways, moved)
            moments += len(ways.starts) - len(open_)  # each of these is checked once more
            if len(open_):
                waiting.append(_cut(ways.only(open_), np.full(len(open_), 2)))
            overlaps.append(ways.starts[overlapping])
            marks = np.cumsum([travelled, *moved.max(axis=1)])
            sparse.append(ways.starts[np.diff(marks // SPARSE) > 0])
            travelled = marks[-1]
        return SeenAlong(
            moments, np.unique(np.concatenate(overlaps)), np.unique(np.concatenate(sparse))
        )

    def _expect_few(self, starts: Floats, ends: Floats) -> None:
        """Refuse a curve that takes too many moments.

        Raises:
            MotionError: If it does.
        """
        moments = 0.0
        for first in range(0, len(starts), CHUNK):
            some = slice(first, first + CHUNK)
            moments += np.ceil(self._bounds(self._curve.ways(starts[some], ends[some]))[1]).sum()
        if moments > MOST_MOMENTS:
            raise MotionError(
                f"to certify this motion takes about {moments:.2g} moments, more than"
                f" {MOST_MOMENTS:.2g}; ask for a larger step and turn, or certify it in parts"
            )

    def _bounds(self, ways: Intervals) -> tuple[Floats, Floats]:
        """Return how far parts travel, (n, parts) (m), and into how many pieces to cut, (n,)."""
        moved, turned = self._travel.along(ways)
        return moved, np.maximum(moved.max(axis=1) / self._step, turned.max(axis=1) / self._turn)

    def _look_at(self, ways: Intervals, moved: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the pieces that begin with an overlap, and those others that may have one."""
        overlapping, undecided = [], []
        states = self._curve.at(ways.starts)
        for found, gaps in self._checker.within(states, ways.starts, moved):
            parts = self._parts[found.pairs]
            both = np.take_along_axis(moved[found.states], parts, axis=1)
            nearing = self._travel.nearing(ways.only(found.states), both, parts)
            overlapping.append(found.states[gaps < 0])
            undecided.append(found.states[(nearing > FINEST) & (gaps < nearing + ROUNDING)])
        hits = np.unique(np.concatenate(overlapping))
        return hits, np.setdiff1d(np.concatenate(undecided), hits)


def _cut(ways: Intervals, pieces: Floats) -> tuple[Floats, Floats]:
    """Return starts and ends of ways, each cut into some pieces, (n,)."""
    counts = pieces.astype(np.intp)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(counts.sum()) - firsts) / np.repeat(counts, counts)
    begin, length = np.repeat(ways.starts, counts), np.repeat(ways.ends - ways.starts, counts)
    starts = begin + share * length
    last = np.cumsum(counts) - 1
    ends = np.append(starts[1:], starts[-1:])
    ends[last] = ways.ends
    return starts, ends
