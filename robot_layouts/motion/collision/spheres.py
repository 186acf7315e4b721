"""Balls that contain convex bodies: few, tight, and the same every time.

A body's balls come in clusters: one ball around each cluster sorts out most pairs of bodies, and
the `BALLS` smaller ones within it most of the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats
from robots.bodies.hulls import Hull

BALLS = 8  # in each cluster
MOST_CLUSTERS = 4  # that one body is cut into, if its hulls do not ask for more
WORTH_A_CUT = 0.8  # of the radius; what halves of an elongated body are left with
SMALL = 0.06  # m; the radius of a cluster that is never cut to make it smaller
ROUNDING = 1e-9  # m; added to radii
STEPS = 100  # of the search for the smallest ball, which ends within 2 % or so


@dataclass(frozen=True, eq=False)
class SphereCluster:
    """Some balls, and the one that contains the same part of a body as they do together.

    Attributes:
        middle: Of the one ball, (3,) (m).
        radius: Its radius (m).
        middles: Of the others, (BALLS, 3) (m).
        radii: Their radii, (BALLS,) (m).
        hulls: For each of them the index of the hull of which it contains a part, (BALLS,).
    """

    middle: Floats
    radius: float
    middles: Floats
    radii: Floats
    hulls: NDArray[np.intp]


@lru_cache(maxsize=4096)
def clusters_of(hulls: tuple[Hull, ...]) -> tuple[SphereCluster, ...]:
    """Return balls that contain the hulls of one link, in its frame.

    Args:
        hulls: The hulls.
    """
    pieces = [_Piece(i, hull.corners, _own_axes(hull.corners)) for i, hull in enumerate(hulls)]
    groups = [_PieceGroup(pieces)]
    while True:
        cuts = [(group.radius, i) for i, group in enumerate(groups) if _is_cut(group, len(groups))]
        if not cuts:
            return tuple(group.cluster() for group in groups)
        _, worst = max(cuts)
        groups[worst : worst + 1] = groups[worst].halves


def _is_cut(group: _PieceGroup, groups: int) -> bool:
    """Whether a group becomes two."""
    if len(group.pieces) > BALLS:
        return True
    if group.radius < SMALL or groups == MOST_CLUSTERS:
        return False
    return max(half.radius for half in group.halves) < WORTH_A_CUT * group.radius


class _Piece:
    """A convex piece of a hull, and the ball around it."""

    def __init__(self, hull: int, corners: Floats, axes: Floats) -> None:
        """Take its corners, and the directions along which it may be cut, as columns."""
        self.hull, self.corners, self.axes = hull, corners, axes
        self.middle, self.radius = ball_around(corners)

    @cached_property
    def halves(self) -> list[_Piece]:
        """Both halves, cut across the longest side."""
        along = self.corners @ self.axes
        low, high = along.min(axis=0), along.max(axis=0)
        axis = int((high - low).argmax())
        heights = along[:, axis] - (low[axis] + high[axis]) / 2
        return [_Piece(self.hull, part, self.axes) for part in _cut(self.corners, heights)]


class _PieceGroup:
    """Pieces that lie together, and the ball around them."""

    def __init__(self, pieces: list[_Piece]) -> None:
        """Take the pieces."""
        self.pieces = pieces
        self.corners = np.concatenate([piece.corners for piece in pieces])
        self.middle, self.radius = ball_around(self.corners)

    @cached_property
    def halves(self) -> list[_PieceGroup]:
        """Both halves: of the one piece, or of the pieces in order along the longest side."""
        if len(self.pieces) == 1:
            return [_PieceGroup([half]) for half in self.pieces[0].halves]
        axis = int(np.ptp(self.corners, axis=0).argmax())
        pieces = sorted(self.pieces, key=lambda piece: float(piece.middle[axis]))
        half = len(pieces) // 2
        return [_PieceGroup(pieces[:half]), _PieceGroup(pieces[half:])]

    def cluster(self) -> SphereCluster:
        """Return the balls of the pieces, cut until there are enough."""
        pieces = list(self.pieces)
        while len(pieces) < BALLS:
            worst = max(range(len(pieces)), key=lambda i: pieces[i].radius)
            pieces[worst : worst + 1] = pieces[worst].halves
        return SphereCluster(
            self.middle,
            self.radius,
            np.array([piece.middle for piece in pieces]),
            np.array([piece.radius for piece in pieces]),
            np.array([piece.hull for piece in pieces]),
        )


def ball_around(points: Floats) -> tuple[Floats, float]:
    """Return middle and radius of a small ball that contains some points (m).

    Args:
        points: (n, 3) (m).
    """
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    best, least = middle, np.inf
    for step in range(2, STEPS):
        gaps = points - middle
        squares = np.einsum("ij,ij->i", gaps, gaps)
        far = int(squares.argmax())
        if squares[far] < least:
            best, least = middle, float(squares[far])
        middle = middle + gaps[far] / step
    return best, float(np.sqrt(least)) + ROUNDING


def _own_axes(corners: Floats) -> Floats:
    """Return the directions in which a body is shortest to longest, as columns, (3, 3)."""
    triangles = corners[_triangles(corners)]
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(sides, axis=1)
    middles = triangles.mean(axis=1)
    around = middles - np.average(middles, axis=0, weights=areas)
    _, axes = np.linalg.eigh((around * areas[:, None]).T @ around)
    return axes


def _cut(corners: Floats, heights: Floats) -> tuple[Floats, Floats]:
    """Return the corners of both parts of a convex body that a plane cuts.

    Args:
        corners: The body's corners, (n, 3) (m).
        heights: Of each above the plane, (n,) (m).
    """
    triangles = _triangles(corners)
    ends = np.concatenate([triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    crossing = ends[heights[ends[:, 0]] * heights[ends[:, 1]] < 0]
    one, other = corners[crossing[:, 0]], corners[crossing[:, 1]]
    h, k = heights[crossing[:, 0], None], heights[crossing[:, 1], None]
    section = np.unique(one + (other - one) * (h / (h - k)), axis=0)
    below, above = corners[heights <= 0], corners[heights >= 0]
    return np.concatenate([below, section]), np.concatenate([above, section])


def _triangles(corners: Floats) -> NDArray[np.intp]:
    """Return the corners of triangles whose sides are all edges of a body, (k, 3)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull: Any = ConvexHull(corners)
        return hull.simplices
    except QhullError:  # all but flat: the segments between any two corners hold the edges, too
        return np.array(list(combinations(range(len(corners)), 3)), np.intp)
