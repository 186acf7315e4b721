"""How near robots come to each other, to themselves and to a table, over many joint positions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import Floats, pose_matrix
from layouts.placement import Placement
from robots.bodies.hulls import Hull, RobotModel

Pairs = NDArray[np.intp]  # (n, 2): indices of hulls

FAR = 10.0  # m; what is farther apart is not measured


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

    def only(self, postures: slice) -> Postures:
        """Return some of the postures."""
        return replace(
            self, poses=self.poses[postures], low=self.low[postures], high=self.high[postures]
        )

    def moved(self, by: Floats) -> Postures:
        """Return the same postures elsewhere, by a translation, (3,) (m)."""
        poses = self.poses.copy()
        poses[..., :3, 3] += by
        return replace(self, poses=poses, low=self.low + by, high=self.high + by)


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


def stand(name: str, placement: Placement, model: RobotModel, qpos: Floats) -> Postures:
    """Return a placed robot in some postures.

    Args:
        name: Its name in the layout.
        placement: Where it stands.
        model: Its links and hulls.
        qpos: Joint positions in the descriptor's order, (postures, dof) (rad, m).
    """
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    links = base @ model.kinematics.forward(qpos)
    poses = links[:, [hull.link for hull in model.hulls]]
    names = tuple(model.link_name(i) for i in range(len(model.hulls)))
    return _postures(name, model.hulls, names, poses)


def fixed(name: str, hull: Hull, postures: int) -> Postures:
    """Return a body that never moves, whose corners are in the world frame."""
    poses = np.broadcast_to(np.eye(4), (postures, 1, 4, 4))
    return _postures(name, (hull,), (name,), poses)


def nearest(
    one: Postures, other: Postures, pairs: Sequence[tuple[int, int]] | None = None
) -> Approach | None:
    """Return the nearest approach of two bodies over their postures; None if beyond `FAR`.

    Posture i of one is compared with posture i of the other.

    Args:
        one: Robot or table.
        other: Another, or the same for self-collisions.
        pairs: Pairs of hulls that count; all if None.
    """
    best: Approach | None = None
    for bound, posture, a, b in _candidates(one, other, pairs):
        if bound > (FAR if best is None else max(best.distance, 0.0)):
            break
        approach = _measure(one, other, posture, a, b)
        if best is None or approach.distance < best.distance:
            best = approach
    return best


def touching(
    one: Postures, other: Postures, pairs: Sequence[tuple[int, int]] | None = None
) -> list[Approach]:
    """Return all overlaps of two bodies' hulls, the deepest first; see `nearest`."""
    found = [
        _measure(one, other, posture, a, b)
        for _, posture, a, b in _candidates(one, other, pairs, within=0.0)
    ]
    overlaps = [approach for approach in found if approach.distance < 0]
    return sorted(overlaps, key=lambda approach: approach.distance)


def nearer_than(one: Postures, other: Postures, distance: float) -> bool:
    """Tell whether two bodies come nearer than a distance (m) in any posture."""
    return any(
        _measure(one, other, posture, a, b).distance < distance
        for _, posture, a, b in _candidates(one, other, None, within=distance)
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
    within: float = FAR,
) -> Iterator[tuple[float, int, int, int]]:
    """Yield a lower bound of the distance (m), posture and both hulls, the least bound first."""
    gaps = np.maximum(
        one.low[:, :, None] - other.high[:, None], other.low[:, None] - one.high[:, :, None]
    )
    bounds = np.linalg.norm(np.maximum(gaps, 0.0), axis=-1)
    if pairs is not None:
        counted = np.zeros(bounds.shape[1:], bool)
        counted[tuple(np.array(pairs, int).reshape(-1, 2).T)] = True
        bounds = np.where(counted, bounds, np.inf)
    # Where boxes overlap the bound says nothing; of those, the nearest centres come first.
    centres = np.linalg.norm(
        (one.low + one.high)[:, :, None] - (other.low + other.high)[:, None], axis=-1
    )
    places = np.argwhere(bounds <= within)
    chosen = tuple(places.T)
    for i in np.lexsort((centres[chosen], bounds[chosen])):
        posture, a, b = places[i].tolist()
        yield float(bounds[posture, a, b]), posture, a, b


def _measure(one: Postures, other: Postures, posture: int, a: int, b: int) -> Approach:
    import fcl

    request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)
    result = fcl.DistanceResult()
    bodies: list[Any] = []
    for body, hull in ((one, a), (other, b)):
        pose = body.poses[posture, hull]
        place = fcl.Transform(pose[:3, :3], pose[:3, 3])
        bodies.append(fcl.CollisionObject(body.hulls[hull].geometry, place))
    distance = float(fcl.distance(*bodies, request, result))
    points: Any = result.nearest_points
    near, far = (tuple(float(x) for x in point) for point in points)
    return Approach((one.links[a], other.links[b]), posture, distance, (near, far))
