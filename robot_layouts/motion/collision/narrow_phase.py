"""How far pairs of a cell's solids are apart, by FCL."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, transform
from robot_layouts.motion.collision.broad_phase import CandidatePairs, Indices, seen_from
from robot_layouts.motion.model.bodies import Bodies, LinkPoses
from robots.bodies.overlaps import overlap

TOUCHING = 1e-5  # m; nearer bodies are asked whether they overlap, as everywhere else


class NarrowPhase:
    """FCL's bodies of a cell, two of each solid: one that stays, and one that is put beside it.

    Attributes:
        rows: The row of each solid's part, (solids,).
    """

    def __init__(
        self, bodies: Bodies, pairs: Indices, apart: Floats, link_poses: LinkPoses
    ) -> None:
        """Prepare some pairs.

        Args:
            bodies: The cell.
            pairs: Pairs of its solids, (m, 2).
            apart: How far they have to be apart, (m,) (m).
            link_poses: Where the parts are.
        """
        self._solids = bodies.solids
        self.rows = np.array([link_poses.rows.get(s.part, 0) for s in self._solids], np.intp)
        self._offsets = np.array([s.offset for s in self._solids]).reshape(-1, 4, 4)
        self._apart = dict(zip(map(tuple, pairs.tolist()), apart.tolist(), strict=True))
        self._apart |= {(b, a): distance for (a, b), distance in self._apart.items()}

    def apart(self, a: int, b: int) -> float:
        """Return how far two solids have to be apart (m)."""
        return self._apart[a, b]

    def wanted_of(self, pairs: Indices) -> Floats:
        """Return how far pairs of solids have to be apart, (k,) (m)."""
        return np.array([self._apart[a, b] for a, b in pairs.tolist()], float)

    def too_near(
        self, places: Floats, candidates: CandidatePairs, *, every: bool
    ) -> NDArray[np.bool_]:
        """Tell which candidates are too near to each other, (k,).

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
            candidates: Pairs of solids.
            every: Whether to check all of them, and not only at the first that are too near in
                each state.
        """
        import fcl

        near, done = [False] * len(candidates.states), [False] * places.shape[1]
        asked, wanted = fcl.CollisionRequest(), fcl.DistanceRequest()
        turns, shifts = self._beside(places, candidates)
        rows = zip(candidates.states.tolist(), candidates.pairs.tolist(), strict=True)
        for i, (state, (a, b)) in enumerate(rows):
            if done[state]:
                continue
            one, other = self._stay[a], self._moved[b]
            other.setRotation(turns[i])
            other.setTranslation(shifts[i])
            apart = self._apart[a, b]
            if apart == 0.0:
                near[i] = fcl.collide(one, other, asked, fcl.CollisionResult()) > 0
            else:
                near[i] = fcl.distance(one, other, wanted, fcl.DistanceResult()) < apart
            done[state] = near[i] and not every
        return np.array(near, bool)

    def gaps(
        self, places: Floats, candidates: CandidatePairs, wanted: NDArray[np.bool_]
    ) -> Floats | None:
        """Return how far some candidates are apart, (k,) (m); 0 for those that are not asked for.

        None if one of them is too near.

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
            candidates: Pairs of solids.
            wanted: Which are asked for, (k,).
        """
        import fcl

        gaps, request = np.zeros(len(wanted)), fcl.DistanceRequest()
        asked = fcl.CollisionRequest()
        turns, shifts = self._beside(places, candidates)
        pairs = candidates.pairs.tolist()
        for i in np.flatnonzero(wanted).tolist():
            a, b = pairs[i]
            one, other = self._stay[a], self._moved[b]
            other.setRotation(turns[i])
            other.setTranslation(shifts[i])
            gaps[i] = fcl.distance(one, other, request, fcl.DistanceResult())
            if gaps[i] < self._apart[a, b]:
                return None
            if gaps[i] < TOUCHING and fcl.collide(one, other, asked, fcl.CollisionResult()):
                return None
        return gaps

    def distances(self, places: Floats, candidates: CandidatePairs) -> Floats:
        """Return how far candidates are apart, (k,) (m); -1 for those that overlap.

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
            candidates: Pairs of solids.
        """
        import fcl

        gaps, request = np.empty(len(candidates.states)), fcl.DistanceRequest()
        asked = fcl.CollisionRequest()
        turns, shifts = self._beside(places, candidates)
        for i, (a, b) in enumerate(candidates.pairs.tolist()):
            one, other = self._stay[a], self._moved[b]
            other.setRotation(turns[i])
            other.setTranslation(shifts[i])
            gaps[i] = max(fcl.distance(one, other, request, fcl.DistanceResult()), 0.0)
            if gaps[i] < TOUCHING and fcl.collide(one, other, asked, fcl.CollisionResult()):
                gaps[i] = -1.0
        return gaps

    def update(
        self,
        places: Floats,
        candidates: CandidatePairs,
        best: Floats,
        pairs: list[tuple[int, int] | None],
    ) -> None:
        """Write down for each state which candidates are nearer than the best known so far.

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
            candidates: Pairs of solids.
            best: The least distance known in each state, (n,) (m).
            pairs: Between which solids.
        """
        import fcl

        request = fcl.DistanceRequest()
        turns, shifts = self._beside(places, candidates)
        rows = zip(candidates.states.tolist(), candidates.pairs.tolist(), strict=True)
        for i, (state, (a, b)) in enumerate(rows):
            if candidates.bounds[i] > max(best[state], 0.0):
                continue
            one, other = self._stay[a], self._moved[b]
            other.setRotation(turns[i])
            other.setTranslation(shifts[i])
            distance = float(fcl.distance(one, other, request, fcl.DistanceResult()))
            if distance <= 0.0:
                distance = self.between(places[:, state], a, b)[0]
            if distance < best[state]:
                best[state], pairs[state] = distance, (a, b)

    def between(self, places: Floats, a: int, b: int) -> tuple[float, Floats]:
        """Return the distance of two solids, negative if they overlap, and their nearest points.

        Args:
            places: Poses of the parts, (rows, 4, 4).
            a: One solid.
            b: The other.
        """
        import fcl

        poses = [places[self.rows[i]] @ self._offsets[i] for i in (a, b)]
        one, other = (
            fcl.CollisionObject(self._solids[i].hull.geometry, fcl.Transform(p[:3, :3], p[:3, 3]))
            for i, p in zip((a, b), poses, strict=True)
        )
        request, result = fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult()
        distance = float(fcl.distance(one, other, request, result))
        if distance > 0.0:
            return distance, np.array(result.nearest_points)
        corners = [
            transform(pose, self._solids[i].hull.corners)
            for i, pose in zip((a, b), poses, strict=True)
        ]
        depth, points = overlap(*corners)
        return -depth, points

    def _beside(self, places: Floats, candidates: CandidatePairs) -> tuple[Floats, Floats]:
        """Return where the second of each pair is, seen from the first: (k, 3, 3) and (k, 3)."""
        (a, b), states = candidates.pairs.T, candidates.states
        one = places[self.rows[a], states] @ self._offsets[a]
        other = places[self.rows[b], states] @ self._offsets[b]
        relative = seen_from(one, other)
        return relative[:, :, :3].copy(), relative[:, :, 3].copy()

    @cached_property
    def _stay(self) -> list[Any]:
        return self._objects()

    @cached_property
    def _moved(self) -> list[Any]:
        return self._objects()

    def _objects(self) -> list[Any]:
        import fcl

        return [fcl.CollisionObject(solid.hull.geometry) for solid in self._solids]
