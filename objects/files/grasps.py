"""Places where a gripper with two jaws may hold a thing: opposite sides with room for fingers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from objects.descriptor import Grasp
from objects.shapes import Shape
from objects.solids import sampled, surface
from robot_layouts.kinematics.rotations import Floats, quaternion_of, rotate
from robots.descriptor import Quaternion

MOST = 48
WIDEST, NARROWEST = 0.094, 0.003  # m; what fingers that part by 10 cm can be closed on
POINTS, MANY = 300, 2400  # on the surface that are tried
_WAYS = 12  # round each of them, from which the gripper comes
_OPPOSITE = np.cos(np.radians(12))  # between the two sides that are held
_SLANTED = np.cos(np.radians(20))  # between each of them and how fingers close, where sides slope
_GAP = 0.016  # m; where no finger fits between two parts, they are held together
_SHALLOW = 0.006  # m; by which the tips of fingers may seem to be in the table
_FROM_ABOVE = 0.3  # the sine of how far a gripper may come from below
_APART = 0.01, np.cos(np.radians(25))  # m, and between ways: grasps nearer than both are one
_NEAR = 0.004, np.cos(np.radians(12))  # the same, where more than `MOST` are asked for
_DIGITS = 9

# A hand in its own frame (m): between its tips the origin, z its approach, y as fingers part.
_FINGER = [*product((-0.011, 0, 0.011), (0.002, 0.012), (-0.045, -0.03, -0.015, 0, 0.01))]
_PALM = [*product((-0.025, 0, 0.025), (-1, -0.5, 0, 0.5, 1), (-0.065, -0.045))]


class _Solid(NamedTuple):
    """A convex shape as what lies below all its planes: ``normals @ point <= offsets``."""

    normals: Floats
    offsets: Floats

    def holds(self, points: Floats) -> Floats:
        """Tell of points, (…, 3), whether they are inside."""
        return (points @ self.normals.T <= self.offsets).all(axis=-1)


def proposed(
    held: Sequence[Shape],
    everything: Sequence[Shape],
    centre: Floats,
    lying: Quaternion,
    part: str = "body",
    most: int = MOST,
    points: int | None = None,
    slanted: bool = False,
) -> tuple[Grasp, ...]:
    """Return grasps of some convex shapes, well spread; the same ones each time.

    They are where two sides face each other, fingers have room beside them, and a palm behind
    them. Whether one holds, only physics can tell.

    Args:
        held: What fingers close on.
        everything: What they must not run into, that included.
        centre: Of mass of what is carried, (3,) (m); grasps near to it come first.
        lying: How the thing is turned on its table, wxyz: grippers come from above it.
        part: What is held, as `Grasp.part` has it.
        most: How many there may be; more than `MOST` may be nearer to each other.
        points: How many on the surface are tried; None tries `POINTS`, or `MANY` where more than
            `MOST` are asked for.
        slanted: Whether sides may slope, as those of a cone, so that friction has to keep them.
    """
    many = most > MOST
    apart, points = _NEAR if many else _APART, points or (MANY if many else POINTS)
    solids = [_solid(shape) for shape in everything if shape.collides]
    own = [_solid(shape) for shape in held if shape.collides]
    up = rotate(np.array(lying) * (1, -1, -1, -1), np.array([0.0, 0.0, 1.0]))
    table = min(float((surface(s).corners @ up).min()) for s in everything if s.collides)
    tried = list[tuple[float, Floats, Floats, float]]()
    for middle, closing, width in _opposite(held, own, points, slanted):
        aside = float(np.linalg.norm(np.cross(centre - middle, closing)))
        for approach in _around(closing):
            if approach @ up <= _FROM_ABOVE:
                frame = np.stack([np.cross(closing, approach), closing, approach], axis=1)
                tried.append((aside + 0.02 * float(approach @ up), middle, frame, width))
    chosen = list[tuple[Floats, Floats, float]]()
    for _, middle, frame, width in sorted(tried, key=lambda one: one[0]):
        if 2 * len(chosen) >= most:
            break
        if any(_alike(middle, frame, *other[:2], apart) for other in chosen):
            continue
        hand = middle + _hand(width) @ frame.T
        deep = (hand @ up).min() < table - _SHALLOW
        if not deep and not any(solid.holds(hand).any() for solid in solids):
            chosen.append((middle, frame, width))
    over = np.diag([-1.0, -1.0, 1.0])  # the same grasp with the fingers the other way round
    return tuple(
        _grasp(middle, frame @ turn, width, part)
        for middle, frame, width in chosen
        for turn in (np.eye(3), over)
    )


def _alike(
    place: Floats, frame: Floats, other: Floats, turned: Floats, apart: tuple[float, float]
) -> bool:
    """Tell whether two grasps are as good as one."""
    near, alike = apart
    return bool(np.linalg.norm(place - other) <= near and frame[:, 2] @ turned[:, 2] >= alike)


def _solid(shape: Shape) -> _Solid:
    found = surface(shape)
    normals = found.normals
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0] / lengths[lengths > 0, None]
    one = found.corners[found.triangles[lengths > 0, 0]]
    planes = np.column_stack([normals, np.einsum("ij,ij->i", normals, one)])
    planes = planes[np.unique(np.round(planes, 6), axis=0, return_index=True)[1]]
    return _Solid(planes[:, :3], planes[:, 3])


def _opposite(
    held: Sequence[Shape], solids: Sequence[_Solid], tried: int, slanted: bool
) -> Iterator[tuple[Floats, Floats, float]]:
    """Yield the middle between opposite sides, the way in which fingers close, and the width."""
    shapes = [shape for shape in held if shape.collides]
    areas = [np.linalg.norm(surface(shape).normals, axis=1).sum() for shape in shapes]
    random = np.random.default_rng(0)
    for shape, solid, area in zip(shapes, solids, areas, strict=True):
        count = max(round(tried * area / sum(areas)), 12)
        points = sampled(surface(shape), count, random)
        sides = (points @ solid.normals.T - solid.offsets).argmax(axis=1)
        for point, normal in zip(points, solid.normals[sides], strict=True):
            closing, limit = normal, _OPPOSITE
            width, other = _through(point, -closing, solids)
            if slanted and np.linalg.norm(normal - other) > 1:
                closing, limit = (normal - other) / np.linalg.norm(normal - other), _SLANTED
                width, other = _through(point, -closing, solids)
            sides_met = min(normal @ closing, other @ -closing)
            if NARROWEST <= width <= WIDEST and sides_met >= limit:
                yield point - closing * width / 2, closing, width


def _through(point: Floats, way: Floats, solids: Sequence[_Solid]) -> tuple[float, Floats]:
    """Return how far a straight line runs inside solids (m), and the normal where it comes out."""
    spans = list[tuple[float, float, Floats]]()
    for solid in solids:
        slope, room = solid.normals @ way, solid.offsets - solid.normals @ point
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = room / slope
        entry = ends[slope < 0].max(initial=-np.inf)
        ahead = np.where(slope > 0, ends, np.inf)
        leave = ahead.argmin()
        if entry < ahead[leave] and not ((slope == 0) & (room < 0)).any():
            spans.append((float(entry), float(ahead[leave]), solid.normals[leave]))
    end, normal = 0.0, -way
    for entry, leaves, out in sorted(spans, key=lambda span: span[0]):
        if entry <= end + _GAP and leaves > end:
            end, normal = leaves, out
    return end, normal


def _around(closing: Floats) -> Iterator[Floats]:
    side = np.cross(closing, np.eye(3)[int(np.abs(closing).argmin())])
    side /= np.linalg.norm(side)
    other = np.cross(closing, side)
    for angle in 2 * np.pi * np.arange(_WAYS) / _WAYS:
        yield np.cos(angle) * side + np.sin(angle) * other


def _hand(width: float) -> Floats:
    """Return points of a hand that is open a little wider than what it holds, (n, 3) (m)."""
    finger, palm = np.array(_FINGER), np.array(_PALM)
    finger = finger + (0.0, width / 2, 0.0)
    palm = palm * (1.0, width / 2 + 0.02, 1.0)
    return np.concatenate([finger, finger * (1.0, -1.0, 1.0), palm])


def _grasp(middle: Floats, frame: Floats, width: float, part: str) -> Grasp:
    x, y, z = (round(float(number), _DIGITS) for number in middle)
    w, i, j, k = (round(number, _DIGITS) for number in quaternion_of(frame).tolist())
    return Grasp((x, y, z), (w, i, j, k), round(width, _DIGITS), part)
