"""How deep two convex bodies overlap.

FCL's own answer to that ends the process for some bodies of a thousand corners, which is why it is
asked only whether bodies overlap, and how far they are apart.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot_layouts.kinematics.rotations import Floats

NEAR_ENOUGH = 1e-9  # m; of a face of the bodies' difference
MOST_POINTS = 500  # of the polytope that grows within it

_FIRST = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], float)


class Penetration(NamedTuple):
    """An overlap of two bodies.

    Attributes:
        depth: The shortest way that parts them (m).
        points: The point of each that lies deepest in the other, (2, 3) (m).
    """

    depth: float
    points: Floats


def overlap(one: Floats, other: Floats) -> Penetration:
    """Measure the overlap of two convex bodies; a depth of 0 if they do not overlap.

    A polytope grows within the bodies' Minkowski difference at the face that is nearest to the
    origin, until that face is one of the difference itself (the expanding polytope algorithm).

    Args:
        one: The corners of a body with a volume, (n, 3) (m).
        other: Those of the other.
    """
    from scipy.spatial import ConvexHull

    corners = [_corner(one, other, direction) for direction in _FIRST if direction.any()]
    hull: Any = ConvexHull([a - b for a, b in corners], incremental=True)
    while True:
        nearest = int(hull.equations[:, 3].argmax())
        normal, offset = hull.equations[nearest, :3], hull.equations[nearest, 3]
        a, b = _corner(one, other, normal)
        farther = float(normal @ (a - b))
        if farther <= 0.0:
            return Penetration(0.0, np.array([a, b]))
        if farther + offset < NEAR_ENOUGH or len(corners) >= MOST_POINTS:
            break
        corners.append((a, b))
        hull.add_points((a - b)[None])
    depth = float(-offset)
    ends = np.array([corners[i] for i in hull.simplices[nearest]])  # (3, 2, 3)
    triangle = (ends[:, 0] - ends[:, 1]).T
    weights = np.linalg.lstsq(np.vstack([triangle, np.ones(3)]), [*(normal * depth), 1.0])[0]
    return Penetration(depth, np.einsum("i,ijk->jk", weights, ends))


def _corner(one: Floats, other: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return the corners whose difference lies farthest in a direction."""
    return one[(one @ direction).argmax()], other[(other @ direction).argmin()]
