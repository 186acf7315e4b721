"""Whether a straight way between two states is free, without checking most states on it.

In the middle of a stretch, what is farther apart than it can come nearer along half of the stretch
cannot collide on any of it. What is left is checked in both halves, and so on, down to
single steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.broad_phase import BroadPhase, Indices
from robot_layouts.motion.collision.narrow_phase import NarrowPhase
from robot_layouts.motion.collision.travel import TravelBounds

STRETCHES = 12  # at first, at most
FINE = 0.1  # m; where pairs come nearer by less, it pays to measure all of them
ROUNDING = 1e-5  # m; of distances that FCL finds by iteration


class _Left(NamedTuple):
    """Stretches of a way that are not known to be free.

    Attributes:
        middles: The step in the middle of each, (m,).
        parents: Numbers of the stretches that they are halves of, (m,).
        keys: Those pairs of solids there that are left, and for each the stretch, as one number.
    """

    middles: Indices
    parents: Indices
    keys: Indices


class Edges:
    """Checks of straight ways."""

    def __init__(
        self, broad_phase: BroadPhase, narrow_phase: NarrowPhase, travel: TravelBounds
    ) -> None:
        """Take what is asked of single states."""
        self._broad_phase, self._narrow_phase, self._travel = broad_phase, narrow_phase, travel
        self._parts = np.array([*broad_phase.link_poses.rows], np.intp)

    def free(
        self, start: Floats, end: Floats, steps: int, times: tuple[float, float] | None
    ) -> bool:
        """Tell whether all states that are whole steps from the start are free.

        Args:
            start: Coordinates, (D,) (rad, m).
            end: Coordinates, (D,) (rad, m).
            steps: How many steps lead from start to end.
            times: When the way begins and ends (s), for obstacles that move.
        """
        half = 0
        while (steps + 1) / (2 * half + 1) > STRETCHES:
            half = 2 * half + 1
        middles = np.arange(half, steps + 1 + half, 2 * half + 1)
        left = _Left(middles, np.zeros(0, np.intp), np.zeros(0, np.intp))
        changes = self._travel.between(start, end, times)[np.ix_(self._parts, self._parts)] / steps
        first = True
        while True:
            shares = np.minimum(left.middles, steps) / steps
            states = start + shares[:, None] * (end - start)
            moments = None if times is None else times[0] + shares * (times[1] - times[0])
            keys = self._left(states, moments, changes * half, None if first else left)
            if keys is None:
                return False
            if not len(keys) or half == 0:
                return True
            half, first = half // 2, False
            left = self._halves(left.middles, keys, half, steps)

    def _left(
        self, states: Floats, moments: Floats | None, more: Floats, known: _Left | None
    ) -> Indices | None:
        """Return the pairs that may be too near somewhere around each state; None if one is there.

        Args:
            states: The middles of the stretches, (n, D) (rad, m).
            moments: When (s).
            more: How much nearer two parts can come within half a stretch, (rows, rows) (m).
            known: What is left of the stretches before; None if that is everything.
        """
        places = self._broad_phase.link_poses.places(states, moments)
        found = self._broad_phase.candidates(places, more=more)
        keys = self._keys(found.states, found.pairs)
        if known is not None:
            kept = np.isin(self._keys(known.parents[found.states], found.pairs), known.keys)
            found, keys = found.only(kept), keys[kept]
        rows = self._narrow_phase.rows[found.pairs]
        slack, apart = more[rows[:, 0], rows[:, 1]], self._narrow_phase.wanted_of(found.pairs)
        asked = (found.bounds <= apart) | (slack < FINE)
        gaps = self._narrow_phase.gaps(places, found, asked)
        return None if gaps is None else keys[gaps <= apart + slack + ROUNDING]

    def _keys(self, stretches: Indices, pairs: Indices) -> Indices:
        size = len(self._narrow_phase.rows)
        return (stretches * size + pairs[:, 0]) * size + pairs[:, 1]

    def _halves(self, middles: Indices, keys: Indices, half: int, steps: int) -> _Left:
        """Return both halves of the stretches in which pairs are left."""
        parents = np.unique(keys // len(self._narrow_phase.rows) ** 2)
        both = middles[parents, None] + (half + 1) * np.array([-1, 1])
        parents = np.repeat(parents, 2)
        inside = both.ravel() - half <= steps
        return _Left(both.ravel()[inside], parents[inside], keys)
