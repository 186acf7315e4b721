"""How a thing can lie on a table: the sides on which its centre of mass keeps it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from objects.files.convex import hull_of
from objects.shapes import Place
from objects.solids import rounded_turn
from robot_layouts.kinematics.rotations import Floats, quaternion_about
from robots.descriptor import Quaternion

UPRIGHT = "upright"
STEADY = np.radians(8)  # by which it can be tilted before it topples, at least
_TOUCHES = 3e-5  # m; what is this near to the table carries it
_ALIKE = np.cos(np.radians(15))  # between the undersides of two rests
_AS_MADE = np.cos(np.radians(10))  # between what is upright and the file's own z axis
_MOST = 4
_LEVEL = 1e-9


class _Side(NamedTuple):
    """A side that a thing can lie on.

    Attributes:
        down: Which way is down then, in its own frame, (3,).
        steady: By how much it can be tilted before it topples (rad).
    """

    down: Floats
    steady: float


def resting(corners: Sequence[Place] | Floats, centre: Place | Floats) -> Mapping[str, Quaternion]:
    """Return how a thing can lie on a table, as `ObjectDescriptor.rests` has it.

    If it stands as its file has it, that is ``"upright"`` and comes first; the others are
    ``"side_1"`` and so on, the steadiest first. What is nowhere steady has its steadiest side.

    Args:
        corners: Of all that collides of it (m).
        centre: Its centre of mass (m).
    """
    points, middle = np.array(corners), np.array(centre)
    sides = sorted(_sides(points, middle), key=lambda side: -side.steady)
    chosen = list[_Side]()
    for side in sides:
        if (side.steady >= STEADY or not chosen) and all(
            side.down @ one.down < _ALIKE for one in chosen
        ):
            chosen.append(side)
    as_made = [side for side in chosen if -side.down[2] >= _AS_MADE][:1]
    others = [side for side in chosen if -side.down[2] < _AS_MADE][:_MOST]
    names = [UPRIGHT] * len(as_made) + [f"side_{i + 1}" for i in range(len(others))]
    return {name: _turned(side.down) for name, side in zip(names, as_made + others, strict=True)}


def _sides(points: Floats, centre: Floats) -> Iterator[_Side]:
    normals = hull_of(points).equations[:, :3]
    for i in np.unique(np.round(normals, 3), axis=0, return_index=True)[1]:
        way = normals[i]
        heights = points @ way
        carrying = points[heights > heights.max() - _TOUCHES]
        inside = _margin(carrying, centre, way)
        if inside > 0:
            yield _Side(way, float(np.arctan2(inside, heights.max() - centre @ way)))


def _margin(carrying: Floats, centre: Floats, down: Floats) -> float:
    """Return how far inside the edge of what carries it a centre of mass is (m)."""
    along = np.eye(3)[int(np.abs(down).argmin())]
    one = np.asarray(np.cross(down, along), float)
    other = np.asarray(np.cross(down, one), float)
    flat = (carrying - centre) @ np.stack([one, other], axis=1) / np.linalg.norm(one)
    edge = hull_of(flat)
    return -1.0 if edge is None else float(-edge.equations[:, 2].max())


def _turned(down: Floats) -> Quaternion:
    """Return the least turn that makes a way of the thing point down, wxyz."""
    x, y, z = down.tolist()
    aside = float(np.hypot(x, y))
    axis = (-y / aside, x / aside, 0.0) if aside > _LEVEL else (1.0, 0.0, 0.0)
    return rounded_turn(quaternion_about(axis, np.arctan2(aside, -z)))
