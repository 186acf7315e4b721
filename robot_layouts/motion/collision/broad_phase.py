"""Which bodies of a cell may be near each other, in many states at once; never one too few.

A pair of clusters of balls is checked in three steps: the ball around each, the balls within,
and what is left is a pair of hulls that has to be measured. Two balls are apart if d² > (r + s)²,
and with x = (c, r, c² - r², 1) that is a product x M x', so that all pairs are one matrix product.
Bodies with a few flat sides that never move, such as tables, are half-spaces instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, transform
from robot_layouts.motion.collision.spheres import BALLS, SphereCluster, clusters_of
from robot_layouts.motion.model.bodies import WORLD, Bodies, CellSolid, LinkPoses
from robots.bodies.hulls import Hull

Indices = NDArray[np.intp]

MOST_SIDES = 12  # of a body that is taken as half-spaces
ROUNDING = 1e-9  # m; of planes and positions, far more than there is
_RELATIVE = 1e-14  # of squared distances; some dozen times the error of one in double precision

_PRODUCT = np.zeros((6, 6))  # M: -2 c c' - 2 r r' + (c² - r²) 1 + 1 (c'² - r'²)
_PRODUCT[range(4), range(4)] = -2.0
_PRODUCT[4, 5] = _PRODUCT[5, 4] = 1.0

_Found = tuple[Indices, Indices, Indices, Floats]  # states, solids, other solids, lower bounds
_NONE = np.zeros(0, np.intp)
NOTHING: _Found = (_NONE, _NONE, _NONE, np.zeros(0))


class CandidatePairs(NamedTuple):
    """Pairs of solids that may be near each other, each in one state.

    Attributes:
        states: (k,).
        pairs: (k, 2).
        bounds: Lower bounds of their distances, (k,) (m); also negative.
    """

    states: Indices
    pairs: Indices
    bounds: Floats

    def only(self, which: NDArray[Any]) -> CandidatePairs:
        """Return some of them."""
        return CandidatePairs(self.states[which], self.pairs[which], self.bounds[which])


@dataclass(frozen=True, eq=False)
class _Clusters:
    """The clusters of all bodies that are taken as balls, in the frames of their parts.

    Attributes:
        rows: Of their parts, (C,).
        around: Middle of the ball around each, and 1, (C, 4, 1) (m).
        radii: Its radius, (C,) (m).
        balls: Middles of those within, and 1, (C, 4, BALLS) (m).
        inner: Their radii, (C, BALLS) (m).
        features: x M of those within, (C, BALLS, 6).
        solids: The solid of each of those, (C, BALLS).
        whole: Whether these are all the same, (C,).
        links: Numbers of the links, or other bodies, that they belong to, (C,).
    """

    rows: Indices
    around: Floats
    radii: Floats
    balls: Floats
    inner: Floats
    features: Floats
    solids: Indices
    whole: NDArray[np.bool_]
    links: Indices


@dataclass(frozen=True, eq=False)
class _Flats:
    """Bodies that never move, as half-spaces.

    Attributes:
        solids: Which, (F,).
        normals: Of their sides, outwards, the first repeated, (F, sides, 3).
        offsets: Distances of the sides from the origin, (F, sides) (m).
    """

    solids: Indices
    normals: Floats
    offsets: Floats


class BroadPhase:
    """Sorts out pairs of a cell's solids that are surely far enough apart.

    Attributes:
        link_poses: Where the parts are.
    """

    def __init__(self, bodies: Bodies, pairs: Indices, apart: Floats) -> None:
        """Prepare some pairs.

        Args:
            bodies: The cell.
            pairs: Pairs of its solids, (m, 2).
            apart: How far they have to be apart, (m,) (m).
        """
        count = len(bodies.solids)
        self._apart = np.full((count, count), -np.inf)
        for a, b in (pairs.T, pairs.T[::-1]):
            self._apart[a, b] = apart
        involved = np.unique(pairs).tolist()
        flats = {i: sides for i in involved if (sides := _sides(bodies.solids[i])) is not None}
        self.link_poses = LinkPoses(bodies, {bodies.solids[i].part for i in involved})
        self._flats = _gather_flats(flats)
        self._clusters = _gather(bodies, [i for i in involved if i not in flats], self.link_poses)
        self._prepare_clusters()
        self._prepare_flats()

    def candidates(
        self, places: Floats, within: Floats | None = None, more: Floats | None = None
    ) -> CandidatePairs:
        """Return the pairs that may be too near, by state, the nearest first.

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
            within: How near, for each state, (n,) (m); None is what each pair has to be apart.
            more: How much farther apart two parts have to be, (rows, rows) (m).
        """
        middles = self._middles(places)
        found = [self._from_clusters(places, middles, within, more)]
        if len(self._flats.solids):
            found.append(self._from_flats(places, middles, within, more))
        columns = [np.concatenate(column) for column in zip(*found, strict=True)]
        return self._in_order(*columns)

    def nearest(self, places: Floats) -> CandidatePairs:
        """Return for each state a pair of solids that are near each other, if any are balls.

        Args:
            places: Poses of the parts, (rows, n, 4, 4).
        """
        values = self._values(places, self._middles(places))
        count = len(values)
        if not values.size:
            return self._in_order(*NOTHING)
        with np.errstate(invalid="ignore"):
            distances = np.sqrt(np.maximum(values + self._sums**2, 0.0))
        counts = self._pair_apart > -np.inf
        gaps = np.where(counts, distances - self._sums, np.inf).reshape(count, -1)
        best = gaps.argmin(axis=1)
        states = np.arange(count)
        a, b = np.unravel_index(best, counts.shape)
        apart = gaps[states, best] + 2 * self._sums[a, b]  # they hold something that is nearer
        found = self._in_order(
            *self._within_clusters(places, states, self._left[a], self._right[b], apart)
        )
        return found.only(np.unique(found.states, return_index=True)[1])

    # -- preparation -------------------------------------------------------------------------

    def _prepare_clusters(self) -> None:
        """Say how far clusters have to be apart, and put those with the most pairs into rows."""
        links, radii = self._clusters.links, self._clusters.radii
        count, most = len(links), int(links.max(initial=-1)) + 1
        of_solid = np.zeros(len(self._apart), np.intp)
        of_solid[self._clusters.solids] = links[:, None]
        balls = np.zeros(len(self._apart), bool)
        balls[self._clusters.solids] = True
        a, b = np.nonzero((self._apart > -np.inf) & balls & balls[:, None])
        between = np.full((most, most), -np.inf)
        np.maximum.at(between, (of_solid[a], of_solid[b]), self._apart[a, b])
        apart = between[np.ix_(links, links)]
        degrees = (apart > -np.inf).sum(axis=1)
        rank = np.empty(count, np.intp)
        rank[np.argsort(-degrees, kind="stable")] = np.arange(count)
        apart = np.where(rank[:, None] < rank, apart, -np.inf)  # each pair once
        counts = apart > -np.inf
        self._left, self._right = np.flatnonzero(counts.any(axis=1)), np.flatnonzero(counts.any(0))
        self._pair_apart = apart[np.ix_(self._left, self._right)]
        self._sums = radii[self._left, None] + radii[self._right]
        self._limits = self._limit(self._pair_apart)

    def _prepare_flats(self) -> None:
        """Say how far clusters have to be from half-spaces."""
        solids = self._clusters.solids
        self._flat_apart = self._apart[solids[:, :, None], self._flats.solids].max(
            axis=1, initial=-np.inf
        )
        self._beside = np.flatnonzero((self._flat_apart > -np.inf).any(axis=1))
        self._flat_apart = self._flat_apart[self._beside]
        self._flat_limits = self._flat_apart + self._clusters.radii[self._beside, None] + ROUNDING

    def _limit(self, apart: Floats) -> Floats:
        """Return up to which d² - (r + s)² clusters are nearer than a distance, (…, L, R)."""
        with np.errstate(invalid="ignore"):
            limits = apart * (2 * self._sums + apart)
        return np.where(apart > -np.inf, limits, -np.inf)

    # -- the balls around clusters -----------------------------------------------------------

    def _middles(self, places: Floats) -> Floats:
        """Return the middles of the balls around clusters, (C, n, 3) (m)."""
        clusters, count = self._clusters, places.shape[1]
        frames = places[clusters.rows, :, :3]
        middles = frames.reshape(len(clusters.rows), 3 * count, 4) @ clusters.around
        return middles.reshape(len(clusters.rows), count, 3)

    def _values(self, places: Floats, middles: Floats) -> Floats:
        """Return d² - (r + s)² of the balls around clusters, (n, L, R) (m²)."""
        features = np.empty((places.shape[1], len(middles), 6))
        features[..., :3] = middles.transpose(1, 0, 2)
        radii = self._clusters.radii
        features[..., 3] = radii
        squares = np.einsum("nci,nci->nc", features[..., :3], features[..., :3])
        features[..., 4] = squares * (1 - _RELATIVE) - radii * radii
        features[..., 5] = 1.0
        return (features[:, self._left] @ _PRODUCT) @ features[:, self._right].transpose(0, 2, 1)

    def _from_clusters(
        self, places: Floats, middles: Floats, within: Floats | None, more: Floats | None
    ) -> _Found:
        values = self._values(places, middles)
        wanted, limits = self._pair_apart, self._limits
        if within is not None:
            wanted = np.where(wanted > -np.inf, within[:, None, None], -np.inf)
            limits = self._limit(wanted)
        elif more is not None:
            rows = self._clusters.rows
            wanted = wanted + more[np.ix_(rows[self._left], rows[self._right])]
            limits = self._limit(wanted)
        states, a, b = np.unravel_index(np.flatnonzero(values <= limits), values.shape)
        apart = wanted[a, b] if within is None else within[states]
        return self._within_clusters(places, states, self._left[a], self._right[b], apart)

    def _within_clusters(
        self, places: Floats, states: Indices, one: Indices, other: Indices, apart: Floats
    ) -> _Found:
        """Look at the balls in pairs of clusters; return states, solids and lower bounds."""
        if not len(states):
            return NOTHING
        clusters = self._clusters
        relative = seen_from(
            places[clusters.rows[one], states], places[clusters.rows[other], states]
        )
        features = np.empty((len(states), 6, BALLS))
        np.matmul(relative, clusters.balls[other], out=features[:, :3])
        squares = np.einsum("mik,mik->mk", features[:, :3], features[:, :3])
        radii = clusters.inner[other] + apart[:, None]
        features[:, 3] = radii
        features[:, 4] = squares * (1 - _RELATIVE) - radii * radii
        features[:, 5] = 1.0
        values = clusters.features[one] @ features
        near = np.flatnonzero((values.reshape(len(states), BALLS * BALLS) <= 0.0).any(axis=1))
        states, one, other, apart = states[near], one[near], other[near], apart[near]
        sums = clusters.inner[one, :, None] + clusters.inner[other, None]
        squares = values[near] + (sums + apart[:, None, None]) ** 2
        gaps = (np.sqrt(np.maximum(squares, 0.0)) - sums).reshape(len(near), BALLS * BALLS)
        whole = clusters.whole[one] & clusters.whole[other]
        entry, ball = np.nonzero((gaps <= apart[:, None]) & ~whole[:, None])
        first, second = np.divmod(ball, BALLS)
        return (
            np.concatenate([states[whole], states[entry]]),
            np.concatenate([clusters.solids[one[whole], 0], clusters.solids[one[entry], first]]),
            np.concatenate(
                [clusters.solids[other[whole], 0], clusters.solids[other[entry], second]]
            ),
            np.concatenate([gaps[whole].min(axis=1, initial=np.inf), gaps[entry, ball]]),
        )

    # -- half-spaces -------------------------------------------------------------------------

    def _from_flats(
        self, places: Floats, middles: Floats, within: Floats | None, more: Floats | None
    ) -> _Found:
        flats, clusters = self._flats, self._clusters
        heights = middles[self._beside] @ flats.normals.reshape(-1, 3).T  # (B, n, F * sides)
        heights = heights.reshape(*heights.shape[:2], *flats.offsets.shape) - flats.offsets
        gaps = heights.max(axis=-1)
        wanted, limits = self._flat_apart, self._flat_limits[:, None]
        if within is not None:
            wanted = np.where(wanted[:, None] > -np.inf, within[:, None], -np.inf)
            limits = wanted + clusters.radii[self._beside, None, None] + ROUNDING
        elif more is not None:
            wanted = wanted + more[clusters.rows[self._beside], WORLD, None]
            limits = (wanted + clusters.radii[self._beside, None] + ROUNDING)[:, None]
        at, states, flat = np.unravel_index(np.flatnonzero(gaps <= limits), gaps.shape)
        apart = wanted[at, flat] if within is None else within[states]
        cluster = self._beside[at]
        balls = places[clusters.rows[cluster], states, :3] @ clusters.balls[cluster]
        heights = flats.normals[flat] @ balls - flats.offsets[flat, :, None]
        bounds = heights.max(axis=1) - clusters.inner[cluster] - ROUNDING
        entry, ball = np.nonzero(bounds <= apart[:, None])
        solids = clusters.solids[cluster[entry], ball]
        return states[entry], solids, flats.solids[flat[entry]], bounds[entry, ball]

    def _in_order(self, states: Indices, a: Indices, b: Indices, bounds: Floats) -> CandidatePairs:
        """Return each pair once in each state, with its least bound, the least first."""
        if not len(states):
            return CandidatePairs(states, np.zeros((0, 2), np.intp), bounds)
        counts = np.flatnonzero(self._apart[a, b] > -np.inf)
        states, bounds = states[counts], bounds[counts]
        a, b = np.minimum(a[counts], b[counts]), np.maximum(a[counts], b[counts])
        size = len(self._apart)
        keys = (states * size + a) * size + b
        order = np.lexsort((bounds, keys))
        keys = keys[order]
        firsts = np.ones(len(keys), bool)
        np.not_equal(keys[1:], keys[:-1], out=firsts[1:])
        order = order[firsts]
        order = order[np.lexsort((bounds[order], states[order]))]
        return CandidatePairs(states[order], np.stack([a[order], b[order]], axis=-1), bounds[order])


def seen_from(frames: Floats, poses: Floats) -> Floats:
    """Return poses in the frames of others, without their last rows, (…, 3, 4) (m).

    Args:
        frames: World poses of the frames, (…, 4, 4).
        poses: World poses, (…, 4, 4).
    """
    moved = poses[..., :3, :].copy()
    moved[..., 3] -= frames[..., :3, 3]
    return np.swapaxes(frames[..., :3, :3], -1, -2) @ moved


def _gather(bodies: Bodies, solids: list[int], link_poses: LinkPoses) -> _Clusters:
    """Return the clusters of some solids; those of one link lie in clusters together."""
    links: dict[tuple[str, int], list[int]] = {}
    for i in solids:
        links.setdefault((bodies.solids[i].name, bodies.solids[i].part), []).append(i)
    placed = [_placed((), np.eye(4).tobytes())]  # of none, so that there is one at least
    placed += [
        _placed(tuple(bodies.solids[i].hull for i in own), bodies.solids[own[0]].offset.tobytes())
        for own in links.values()
    ]
    counts = [len(clusters.radii) for clusters in placed[1:]]
    solid = np.concatenate(
        [
            np.array(own, np.intp)[clusters.hulls]
            for own, clusters in zip([[0], *links.values()], placed, strict=True)
        ]
    )
    features = np.concatenate([clusters.features for clusters in placed])
    return _Clusters(
        rows=np.repeat(np.array([link_poses.rows[part] for _, part in links], np.intp), counts),
        around=np.concatenate([clusters.around for clusters in placed]),
        radii=np.concatenate([clusters.radii for clusters in placed]),
        balls=np.concatenate([clusters.balls for clusters in placed]),
        inner=np.concatenate([clusters.inner for clusters in placed]),
        features=features @ _PRODUCT,
        solids=solid,
        whole=(solid == solid[:, :1]).all(axis=1),
        links=np.repeat(np.arange(len(links)), counts),
    )


class _Placed(NamedTuple):
    """The clusters of one link, in the frame of its part; see `_Clusters`.

    Attributes:
        around: (C, 4, 1).
        radii: (C,).
        balls: (C, 4, BALLS).
        inner: (C, BALLS).
        features: x of those within, (C, BALLS, 6).
        hulls: The hull of each of those, by its place among the link's, (C, BALLS).
    """

    around: Floats
    radii: Floats
    balls: Floats
    inner: Floats
    features: Floats
    hulls: Indices


@lru_cache(maxsize=4096)
def _placed(hulls: tuple[Hull, ...], offset: bytes) -> _Placed:
    """Return the clusters of the hulls of a link.

    Args:
        hulls: The hulls.
        offset: Pose of their frame in that of their part, (4, 4) (m), as bytes.
    """
    pose = np.frombuffer(offset).reshape(4, 4)
    clusters = [_moved(cluster, pose) for cluster in (clusters_of(hulls) if hulls else ())]
    count = len(clusters)
    around, balls = np.ones((count, 4, 1)), np.ones((count, 4, BALLS))
    features, own = np.ones((count, BALLS, 6)), np.empty((count, BALLS), np.intp)
    for i, cluster in enumerate(clusters):
        around[i, :3, 0], balls[i, :3] = cluster.middle, cluster.middles.T
        features[i, :, :3], features[i, :, 3] = cluster.middles, cluster.radii
        squares = (cluster.middles**2).sum(axis=1)
        features[i, :, 4] = squares * (1 - _RELATIVE) - cluster.radii**2
        own[i] = cluster.hulls
    radii = np.array([cluster.radius for cluster in clusters], float)
    return _Placed(around, radii, balls, features[..., 3].copy(), features, own)


def _moved(cluster: SphereCluster, pose: Floats) -> SphereCluster:
    """Return a cluster somewhere else, at a pose, (4, 4) (m)."""
    turn, at = pose[:3, :3], pose[:3, 3]
    return replace(
        cluster, middle=turn @ cluster.middle + at, middles=cluster.middles @ turn.T + at
    )


def _gather_flats(flats: Mapping[int, Floats]) -> _Flats:
    most = max(map(len, flats.values()), default=0)
    sides = np.zeros((len(flats), most, 4))
    for row, own in zip(sides, flats.values(), strict=True):
        row[:] = own[0]
        row[: len(own)] = own
    return _Flats(np.array([*flats], np.intp), sides[..., :3].copy(), sides[..., 3].copy())


def _sides(solid: CellSolid) -> Floats | None:
    """Return the sides of a body that never moves: normals and distances from the origin, (s, 4).

    None if it moves, is a robot's, or has too many.
    """
    if solid.part != WORLD or solid.name != solid.owner:
        return None
    return _sides_of(solid.hull, solid.offset.tobytes())


@lru_cache(maxsize=256)
def _sides_of(hull: Hull, offset: bytes) -> Floats | None:
    from scipy.spatial import ConvexHull, QhullError

    corners = transform(np.frombuffer(offset).reshape(4, 4), hull.corners)
    try:
        found: Any = ConvexHull(corners)
    except QhullError:  # too small for how far from the origin it is
        return None
    normals = np.unique(np.round(found.equations[:, :3], 9), axis=0)
    if len(normals) > MOST_SIDES:
        return None
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return np.column_stack([normals, (corners @ normals.T).max(axis=0)])
