"""Whether the robots of a cell touch each other, themselves or anything else, and where."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layouts.validation.collisions import FAR
from layouts.validation.findings import length_text
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.broad_phase import BroadPhase, CandidatePairs, Indices
from robot_layouts.motion.collision.narrow_phase import NarrowPhase
from robot_layouts.motion.collision.travel import TravelBounds
from robot_layouts.motion.model.bodies import Bodies
from robots import LayoutError

STRETCHES = 12  # at first, at most
FINE = 0.1  # m; where pairs come nearer by less, it pays to measure all of them
ROUNDING = 1e-5  # m; of distances that FCL finds by iteration


Flags = NDArray[np.bool_]

MOST_STATES = 64  # that are checked together; what more need no longer fits into the caches
RESOLUTION = (0.01, 0.05)  # of edges: how far points travel (m) and links turn (rad) in a step


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
    """Checks whether a straight way between two states is free, without most states on it.

    In the middle of a stretch, what is farther apart than it can come nearer along half of the
    stretch cannot collide on any of it. What is left is checked in both halves, and so on, down to
    single steps.
    """

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


@dataclass(frozen=True)
class Contact:
    """Two bodies of a cell, and how near they are.

    Attributes:
        names: ``left/panda_hand`` for a robot's link, else the name of the table or obstacle.
        owners: The robots, tables or obstacles that they belong to.
        distance: Between them (m); negative if they overlap, by how much.
        points: The nearest points of both, or those deepest in the other, world (m).
    """

    names: tuple[str, str]
    owners: tuple[str, str]
    distance: float
    points: tuple[tuple[float, ...], tuple[float, ...]]

    def __str__(self) -> str:
        """Say who, and how near or how deep."""
        one, other = self.names
        if self.distance < 0:
            return f"{one} and {other} overlap by {length_text(-self.distance)}"
        return f"{one} comes within {length_text(self.distance)} of {other}"


class Checker:
    """Tells whether some bodies of a cell come too near to each other; `Cell.checker` makes it.

    The broad phase discards most pairs by batched bounds; FCL measures the rest, and alone would
    give the same answers. A checker holds FCL's bodies, so each thread needs its own.

    Attributes:
        cell: The cell.
        pairs: The pairs of its solids that count, (m, 2).
        apart: How far each pair has to be apart, (m,) (m); 0 lets them touch.
    """

    def __init__(self, cell: Bodies, pairs: NDArray[np.intp], apart: Floats | float) -> None:
        """Prepare the pairs that count.

        Args:
            cell: The cell.
            pairs: Pairs of its solids, (m, 2).
            apart: How far each has to be apart, (m,), or all of them (m).
        """
        self.cell, self.pairs = cell, pairs
        self.apart = apart = np.broadcast_to(np.asarray(apart, float), (len(pairs),))
        self._broad_phase = BroadPhase(cell, pairs, apart)
        self._narrow_phase = NarrowPhase(cell, pairs, apart, self._broad_phase.link_poses)

    @cached_property
    def _edges(self) -> Edges:
        return Edges(self._broad_phase, self._narrow_phase, self._travel)

    @cached_property
    def _travel(self) -> TravelBounds:
        return TravelBounds(self.cell)

    def free(self, qpos: ArrayLike, times: ArrayLike | None = None) -> Flags:
        """Tell for each state whether everything that counts is as far apart as it has to be, (n,).

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        states, moments = self._states(qpos, times)
        parts = [self._free(*part) for part in _batches(states, moments)]
        return np.concatenate(parts) if parts else np.ones(0, bool)

    def contact(self, qpos: ArrayLike, time: float | None = None) -> Contact | None:
        """Return which two bodies are too near; those that miss most of what they have to be apart.

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Returns:
            None where `free` is true.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        return next(iter(self.contacts(qpos, time)), None)

    def contacts(self, qpos: ArrayLike, time: float | None = None) -> list[Contact]:
        """Return all bodies that are too near, those first that miss most of what they have to be.

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        places, pairs = self._close(qpos, time)
        contacts = [self._contact(places, a, b) for a, b in pairs]
        missing = [
            contact.distance - self._narrow_phase.apart(*pair)
            for contact, pair in zip(contacts, pairs, strict=True)
        ]
        return [contacts[i] for i in np.argsort(missing, kind="stable")]

    def close(self, qpos: ArrayLike, time: float | None = None) -> Flags:
        """Tell which of `pairs` are not as far apart as they have to be, (m,).

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        _, pairs = self._close(qpos, time)
        close = {frozenset(pair) for pair in pairs}
        return np.array([frozenset(pair) in close for pair in self.pairs.tolist()], bool)

    def nearest(self, qpos: ArrayLike, time: float | None = None) -> Contact | None:
        """Return which two bodies that count are nearest or overlap most; None beyond `FAR`.

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        places = self._places(*self._one(qpos, time))
        _, (pair,) = self._distances(places)
        return None if pair is None else self._contact(places, *pair)

    def distance(self, qpos: ArrayLike, times: ArrayLike | None = None) -> Floats:
        """Return the least distance of any two bodies that count, (n,) (m); at most `FAR`.

        It is negative where they overlap, by how much.

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        states, moments = self._states(qpos, times)
        parts = [self._distances(self._places(*part))[0] for part in _batches(states, moments)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def edge_free(
        self,
        start: ArrayLike,
        end: ArrayLike,
        resolution: tuple[float, float] = RESOLUTION,
        times: tuple[float, float] | None = None,
    ) -> bool:
        """Tell whether all states on the straight way between two states are free, ends included.

        Args:
            start: Coordinates, (D,) (rad, m).
            end: Coordinates, (D,) (rad, m).
            resolution: How far any point of a robot may travel (m) and any link turn (rad) between
                two states that are looked at, at most.
            times: When the way begins and ends (s), for obstacles that move.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        (a, b), _ = self._states(np.stack([np.asarray(start, float), np.asarray(end, float)]), None)
        return self._edges.free(a, b, self.steps(a, b, resolution, times), times)

    def steps(
        self,
        start: Floats,
        end: Floats,
        resolution: tuple[float, float] = RESOLUTION,
        times: tuple[float, float] | None = None,
    ) -> int:
        """Return into how many steps `edge_free` cuts a way; see there."""
        return self._travel.steps(start, end, resolution, times)

    def within(
        self, qpos: ArrayLike, times: ArrayLike | None, reach: Floats
    ) -> Iterator[tuple[CandidatePairs, Floats]]:
        """Yield, for some states at a time, pairs of solids and how far they are apart (m).

        Those are all pairs that could touch if each part moved from where it is by its reach, and
        some more; -1 stands for pairs that overlap.

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.
            reach: Of each part, (n, parts) (m).

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        rows = list(self._broad_phase.link_poses.rows)
        for first, (states, moments) in zip(
            count(0, MOST_STATES), _batches(*self._states(qpos, times)), strict=False
        ):
            places = self._places(states, moments)
            farthest = reach[first : first + MOST_STATES, rows].max(axis=0)
            found = self._broad_phase.candidates(places, more=farthest[:, None] + farthest)
            gaps = self._narrow_phase.distances(places, found)
            yield found._replace(states=found.states + first), gaps

    def candidates(self, qpos: ArrayLike, times: ArrayLike | None = None) -> CandidatePairs:
        """Return the pairs of solids that bounds alone do not show to be far enough apart.

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong, or a number not finite.
        """
        return self._broad_phase.candidates(self._places(*self._states(qpos, times)))

    # -- one batch ---------------------------------------------------------------------------

    def _free(self, states: Floats, moments: Floats | None) -> Flags:
        places = self._places(states, moments)
        candidates = self._broad_phase.candidates(places)
        free = np.ones(len(states), bool)
        near = self._narrow_phase.too_near(places, candidates, every=False)
        free[candidates.states[near]] = False
        return free

    def _close(self, qpos: ArrayLike, time: float | None) -> tuple[Floats, list[tuple[int, int]]]:
        """Return where the parts are, and the pairs of solids that are too near there."""
        places = self._places(*self._one(qpos, time))
        candidates = self._broad_phase.candidates(places)
        near = self._narrow_phase.too_near(places, candidates, every=True)
        return places, [(a, b) for a, b in candidates.pairs[near].tolist()]

    def _distances(self, places: Floats) -> tuple[Floats, list[tuple[int, int] | None]]:
        """Return the least distance in each state, and between which solids."""
        measure, count = self._narrow_phase, places.shape[1]
        best, pairs = np.full(count, FAR), [None] * count
        measure.update(places, self._broad_phase.nearest(places), best, pairs)
        left = self._broad_phase.candidates(places, np.maximum(best, 0.0))
        measure.update(places, left, best, pairs)
        return best, pairs

    def _places(self, states: Floats, moments: Floats | None) -> Floats:
        return self._broad_phase.link_poses.places(states, moments)

    def _contact(self, places: Floats, a: int, b: int) -> Contact:
        distance, points = self._narrow_phase.between(places[:, 0], a, b)
        one, other = (tuple(float(x) for x in point) for point in points)
        solids = self.cell.solids[a], self.cell.solids[b]
        names, owners = (solids[0].name, solids[1].name), (solids[0].owner, solids[1].owner)
        return Contact(names, owners, distance, (one, other))

    # -- arguments ---------------------------------------------------------------------------

    def _one(self, qpos: ArrayLike, time: float | None) -> tuple[Floats, Floats | None]:
        return self._states(np.asarray(qpos, float)[None], time)

    def _states(self, qpos: ArrayLike, times: ArrayLike | None) -> tuple[Floats, Floats | None]:
        states = np.asarray(qpos, float)
        if states.ndim != 2 or states.shape[1] != self.cell.size:
            raise LayoutError(
                f"joint positions have the shape {states.shape}; this cell takes"
                f" (n, {self.cell.size}): {', '.join(self.cell.robots)}"
            )
        if not np.isfinite(states).all():
            raise LayoutError("joint positions must be finite numbers")
        if times is None:
            return states, None
        moments = np.asarray(times, float)
        if moments.shape not in ((), (len(states),)) or not np.isfinite(moments).all():
            raise LayoutError(
                f"times have the shape {moments.shape}; {len(states)} states take as many times,"
                " finite (s)"
            )
        return states, np.broadcast_to(moments, (len(states),))


def _batches(states: Floats, moments: Floats | None) -> Iterator[tuple[Floats, Floats | None]]:
    for first in range(0, len(states), MOST_STATES):
        part = slice(first, first + MOST_STATES)
        yield states[part], None if moments is None else moments[part]
