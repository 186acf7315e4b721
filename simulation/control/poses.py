"""Arithmetic on single poses in native's order of operations, which decides the last bits.

It stands apart from `kinematics.rotations`, which computes in double precision. All numbers are
NumPy's float32 scalars, which for one pose take a third of the time that arrays do. A pose is
position (m) and quaternion (wxyz), seven of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from kinematics.quaternions import inverted, multiplied
from simulation.maths import Floats, cos, norm, sin, sqrt

Number = np.float32
Row = tuple[Number, ...]

_ONE, _TWO = np.float32(1), np.float32(2)
_NOTHING = np.float32(0)
_LEAST_ROOT = np.float32(0.1)


def row(numbers: Iterable[Any]) -> Row:
    """Return numbers of a float32 array one by one."""
    return tuple(numbers)


def upright(quaternion: Row) -> Row:
    """Return a quaternion with w ≥ 0."""
    w, x, y, z = quaternion
    return (-w, -x, -y, -z) if w < _NOTHING else quaternion


def turned(quaternion: Row, point: Row) -> Row:
    """Return a point, three numbers, turned by a quaternion."""
    return multiplied(multiplied(quaternion, (_NOTHING, *point)), inverted(quaternion))[1:]


def added(one: Row, other: Row) -> Row:
    """Return the sum of two points."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def inverse(pose: Row) -> Row:
    """Return the inverse of a pose."""
    x, y, z, *quaternion = pose
    back = inverted((*quaternion,))
    return *turned(back, (-x, -y, -z)), *back


def combined(first: Row, second: Row) -> Row:
    """Return ``first · second``: the pose ``second`` of what is seen from ``first``."""
    place = added(first[:3], turned(first[3:], second[:3]))
    return *place, *upright(multiplied(first[3:], second[3:]))


def rotation(angles: Floats) -> Row:
    """Return the quaternion, w ≥ 0, of turns about x, then the new y, then the new z, (3,)."""
    cx, cy, cz = cos(angles)
    sx, sy, sz = sin(angles)
    both, other = sx * sy, cx * sy
    return quaternion(
        (cy * cz, -cy * sz, sy),
        (both * cz + cx * sz, both * -sz + cx * cz, -sx * cy),
        (-other * cz + sx * sz, -other * -sz + sx * cz, cx * cy),
    )


def quaternion(first: Row, second: Row, third: Row) -> Row:
    """Return the quaternion, w ≥ 0, of the three rows of a rotation matrix.

    Of the four ways to read it off, the one that divides by the largest number.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = first, second, third
    squares = np.array(
        [
            _ONE + xx + yy + zz,
            _ONE + xx - yy - zz,
            _ONE - xx + yy - zz,
            _ONE - xx - yy + zz,
        ]
    )
    roots = sqrt(np.maximum(squares, _NOTHING))
    largest = int(roots.argmax())
    root = roots[largest]
    found = (
        (root * root, zy - yz, xz - zx, yx - xy),
        (zy - yz, root * root, yx + xy, xz + zx),
        (xz - zx, yx + xy, root * root, zy + yz),
        (yx - xy, zx + xz, zy + yz, root * root),
    )[largest]
    divisor = _TWO * max(root, _LEAST_ROOT)
    return upright(tuple(number / divisor for number in found))


def clipped_turn(angles: Floats) -> Floats:
    """Return angles, (3,), scaled down to a norm of 1 if theirs is above."""
    length = norm(angles[None])[0]
    return angles * (_ONE / length) if length > _ONE else angles
