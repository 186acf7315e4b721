"""How near robots come to each other, to themselves and to a table, over many joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts.frames import Pose
from layouts.placement import Placement
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform
from robots.bodies.hulls import Hull, RobotModel, convex_hull
from robots.bodies.overlaps import overlap

Pairs = NDArray[np.intp]  # (n, 2): indices of hulls

FAR = 10.0  # m; what is farther apart is not measured
FEW = 8  # pairs of hulls that are measured sooner than sorted out
ROUNDING = 1e-5  # m; of distances and directions that FCL finds by iteration


@dataclass(frozen=True, eq=False)
class Postures:
    """One body of the scene (a robot, or the table) in several postures.

    Attributes:
        name: The robot's name in the layout, or ``"table"``.
        hulls: Its convex bodies.
        links: For each hull the name of its link.
        poses: World poses of the hulls' links, (postures, hulls, 4, 4).
        low: Least corner of each hull's box along the world's axes, (postures, hulls, 3) (m).
        high: Greatest corner, same shape.
    """

    name: str
    hulls: tuple[Hull, ...]
    links: tuple[str, ...]
    poses: Floats
    low: Floats
    high: Floats

    @cached_property
    def first(self) -> Postures:
        """The first posture alone."""
        return replace(self, poses=self.poses[:1], low=self.low[:1], high=self.high[:1])

    @cached_property
    def extent(self) -> tuple[Floats, Floats]:
        """Least and greatest corner of each hull's box around all postures, (hulls, 3) (m)."""
        return self.low.min(axis=0), self.high.max(axis=0)

    def lowest(self, approach: Approach) -> float:
        """Return how low the first link of an approach is in its posture (m)."""
        hulls = [i for i, link in enumerate(self.links) if link == approach.links[0]]
        return float(self.low[approach.posture, hulls, 2].min())

    def moved(self, by: Floats) -> Postures:
        """Return the same postures elsewhere, by a translation, (3,) (m)."""
        poses = self.poses.copy()
        poses[..., :3, 3] += by
        return replace(self, poses=poses, low=self.low + by, high=self.high + by)


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Pairs of hulls that may be near, each in one posture.

    Attributes:
        bounds: Lower bounds of their distances, (n,) (m).
        places: Posture, hull of one body and hull of the other, (n, 3).
    """

    bounds: Floats
    places: NDArray[np.intp]

    def only(self, which: slice | NDArray[Any]) -> _Candidates:
        """Return some of them."""
        return _Candidates(self.bounds[which], self.places[which])


@dataclass(frozen=True)
class Approach:
    """Two hulls, and how near they come in one posture.

    Attributes:
        links: The names of their links.
        posture: Which of the postures.
        distance: Between them (m); negative if they overlap, by how much.
        points: The nearest points of both, world (m).
    """

    links: tuple[str, str]
    posture: int
    distance: float
    points: tuple[tuple[float, ...], tuple[float, ...]]


def stand(name: str, base: Pose, model: RobotModel, qpos: Floats) -> Postures:
    """Return a placed robot in some postures.

    Args:
        name: Its name in the layout.
        base: Of its base in the world.
        model: Its links and hulls.
        qpos: Joint positions in the descriptor's order, (postures, dof) (rad, m).
    """
    links = pose_matrix(base.position, base.quaternion) @ model.kinematics.forward(qpos)
    carriers = [hull.link for hull in model.hulls]
    names = tuple([model.kinematics.links[link] for link in carriers])
    return _postures(name, model.hulls, names, links[:, carriers])


def noisy_postures(placement: Placement, draws: int, random: np.random.Generator) -> Floats:
    """Return the keyframe, then draws with joint noise as at a reset, (1 + draws, dof)."""
    groups = placement.robot.action_split.groups.values()
    noisy = [group.reset_noise for group in groups for _ in group.joints]
    noise = random.normal(0.0, placement.qpos_noise, (draws, len(noisy))) * noisy
    return np.array(placement.start_qpos) + np.concatenate([np.zeros((1, len(noisy))), noise])


def moving_hulls(model: RobotModel) -> list[tuple[int, int]]:
    """Pair with the table's one hull all hulls of links that move; the base stands on it."""
    bodies = model.kinematics.bodies
    return [(i, 0) for i, hull in enumerate(model.hulls) if bodies[hull.link] != 0]


def slab_hull(top: Floats, depth: float, name: str) -> Hull:
    """Return what lies below a flat top, as a body of its own in the world frame.

    Args:
        top: Its corners, (n, 3) (m).
        depth: How far it goes down (m).
        name: Its name, for errors.

    Raises:
        AssetError: If it has no volume.
    """
    return convex_hull(0, np.concatenate([top, top - [0.0, 0.0, depth]]), name)


def fixed(name: str, hull: Hull, postures: int) -> Postures:
    """Return a body that never moves, whose corners are in the world frame."""
    poses = np.broadcast_to(np.eye(4), (postures, 1, 4, 4))
    return _postures(name, (hull,), (name,), poses)


def nearest(
    one: Postures,
    other: Postures,
    pairs: Sequence[tuple[int, int]] | None = None,
    best: Approach | None = None,
) -> Approach | None:
    """Return the nearest approach of two bodies over their postures; None if beyond `FAR`.

    Posture i of one is compared with posture i of the other.

    Args:
        one: Robot or table.
        other: Another, or the same for self-collisions.
        pairs: Pairs of hulls that count; all if None.
        best: An approach that is known already; returned if no other is nearer.
    """
    within = FAR if best is None else max(best.distance, 0.0)
    left, done = _candidates(one, other, pairs, within, best), 0
    while done < len(left.places):
        approach = _measure(one, other, *left.places[done].tolist())
        done += 1
        if best is None or approach.distance < best.distance:
            best = approach
            left, done = _those_nearer(left.only(slice(done, None)), one, other, best), 0
    return best


def touching(
    one: Postures, other: Postures, pairs: Sequence[tuple[int, int]] | None = None
) -> list[Approach]:
    """Return all overlaps of two bodies' hulls, the deepest first; see `nearest`."""
    found = [
        _measure(one, other, *place)
        for place in _candidates(one, other, pairs, within=0.0).places.tolist()
    ]
    overlaps = [approach for approach in found if approach.distance < 0]
    return sorted(overlaps, key=lambda approach: approach.distance)


def nearer_than(one: Postures, other: Postures, distance: float) -> bool:
    """Tell whether two bodies come nearer than a distance (m) in any posture."""
    return any(
        _measure(one, other, *place).distance < distance
        for place in _candidates(one, other, None, within=distance).places.tolist()
    )


def _postures(
    name: str, hulls: tuple[Hull, ...], links: tuple[str, ...], poses: Floats
) -> Postures:
    low, high = np.empty((2, *poses.shape[:2], 3))
    for i, hull in enumerate(hulls):
        corners = hull.corners @ poses[:, i, :3, :3].transpose(0, 2, 1) + poses[:, i, None, :3, 3]
        low[:, i], high[:, i] = corners.min(axis=1), corners.max(axis=1)
    return Postures(name, hulls, links, poses, low, high)


def _candidates(
    one: Postures,
    other: Postures,
    pairs: Sequence[tuple[int, int]] | None,
    within: float,
    best: Approach | None = None,
) -> _Candidates:
    """Return what may be within a distance (m) and nearer than the best, the least bound first.

    Where boxes overlap the bound says nothing; of those, the nearest centres come first.
    """
    a, b = _near_pairs(one, other, pairs, within)
    posture = np.arange(len(one.poses))[:, None]
    posture, a, b = map(np.ravel, np.broadcast_arrays(posture, a, b))
    if best is not None and len(a):
        parted = _parted(one, other, posture, a, b, best)
        posture, a, b = posture[~parted], a[~parted], b[~parted]
    low, high = one.low[posture, a], one.high[posture, a]
    other_low, other_high = other.low[posture, b], other.high[posture, b]
    bounds = _box_gaps(low, high, other_low, other_high)
    centres = np.linalg.norm(low + high - other_low - other_high, axis=-1)
    order = np.lexsort((centres, bounds))
    near = order[bounds[order] <= within]
    return _Candidates(bounds[near], np.stack([posture, a, b], axis=-1)[near])


def _near_pairs(
    one: Postures, other: Postures, pairs: Sequence[tuple[int, int]] | None, within: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs of hulls whose boxes around all postures come within a distance (m)."""
    (low, high), (other_low, other_high) = one.extent, other.extent
    near = _box_gaps(low[:, None], high[:, None], other_low, other_high) <= within
    if pairs is not None:
        counted = np.zeros_like(near)
        counted[tuple(np.array(pairs, int).reshape(-1, 2).T)] = True
        near &= counted
    a, b = np.nonzero(near)
    return a, b


def _box_gaps(low: Floats, high: Floats, other_low: Floats, other_high: Floats) -> Floats:
    """Return the distances between boxes along the world's axes (m); 0 where they overlap."""
    gaps = np.maximum(low - other_high, other_low - high)
    return np.linalg.norm(np.maximum(gaps, 0.0), axis=-1)


def _those_nearer(left: _Candidates, one: Postures, other: Postures, best: Approach) -> _Candidates:
    """Return the candidates that may be nearer than the best so far."""
    left = left.only(left.bounds <= max(best.distance, 0.0))
    if len(left.places) < FEW:
        return left
    posture, a, b = left.places.T
    return left.only(~_parted(one, other, posture, a, b, best))


def _parted(
    one: Postures,
    other: Postures,
    posture: NDArray[np.intp],
    a: NDArray[np.intp],
    b: NDArray[np.intp],
    best: Approach,
) -> NDArray[np.bool_]:
    """Tell of pairs of hulls whether they are seen not to be nearer than the best so far.

    Two convex bodies are at least as far apart as between any two parallel planes that part them.
    Those that touch the best pair do for most others too, where robots stand apart.
    """
    way = np.subtract(best.points[1], best.points[0])
    length = float(np.linalg.norm(way))
    if best.distance <= 0.0 or length < ROUNDING:
        return np.zeros(len(a), bool)
    way /= length
    gaps = -_farthest(other, b, -way)[posture, b] - _farthest(one, a, way)[posture, a]
    return gaps > best.distance + ROUNDING


def _farthest(body: Postures, hulls: NDArray[np.intp], way: Floats) -> Floats:
    """Return how far some hulls reach along a direction, (postures, hulls) (m).

    What it returns for other hulls means nothing.
    """
    own = way @ body.poses[..., :3, :3]  # the direction in the frames of the links
    reaches = body.poses[..., :3, 3] @ way
    for hull in np.flatnonzero(np.bincount(hulls)):
        reaches[:, hull] += (own[:, hull] @ body.hulls[hull].corners.T).max(axis=1)
    return reaches


def _measure(one: Postures, other: Postures, posture: int, a: int, b: int) -> Approach:
    import fcl

    request, result = fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult()
    bodies: list[Any] = []
    for body, hull in ((one, a), (other, b)):
        pose = body.poses[posture, hull]
        place = fcl.Transform(pose[:3, :3], pose[:3, 3])
        bodies.append(fcl.CollisionObject(body.hulls[hull].geometry, place))
    distance = float(fcl.distance(*bodies, request, result))
    points: Any = result.nearest_points
    if distance <= 0.0:
        depth, points = overlap(_corners(one, posture, a), _corners(other, posture, b))
        distance = -depth
    near, far = points
    ends = tuple(map(float, near)), tuple(map(float, far))
    return Approach((one.links[a], other.links[b]), posture, distance, ends)


def _corners(body: Postures, posture: int, hull: int) -> Floats:
    return transform(body.poses[posture, hull], body.hulls[hull].corners)
