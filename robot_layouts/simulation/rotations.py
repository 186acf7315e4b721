"""Rotation matrices and angles of quaternions, with the operations of native's helpers.

Their order decides the last bits of observations and rewards, so they stand apart from
`robot_layouts.kinematics.rotations`.
"""

from __future__ import annotations

import numpy as np

from robot_layouts.simulation.maths import Floats, arctan2, number, sqrt

# Products of quaternion entries (w = 0, x = 1, y = 2, z = 3) that each of the nine matrix entries,
# row by row, is the sum or difference of.
_PAIRS = (
    (((2, 2), (3, 3)), 1), (((1, 2), (3, 0)), -1), (((1, 3), (2, 0)), 1),
    (((1, 2), (3, 0)), 1), (((1, 1), (3, 3)), 1), (((2, 3), (1, 0)), -1),
    (((1, 3), (2, 0)), -1), (((2, 3), (1, 0)), 1), (((1, 1), (2, 2)), 1),
)  # fmt: skip
_FIRST = np.array([4 * i + j for ((i, j), _), _ in _PAIRS])
_SECOND = np.array([4 * i + j for (_, (i, j)), _ in _PAIRS])
_SIGN = np.array([sign for _, sign in _PAIRS], np.float32)
_TWO, _ONE = number(2.0), number(1.0)
_NOTHING, _LEAST_ROOT = np.float32(0), np.float32(0.1)

Row = tuple[np.float32, ...]


def rotation_matrix(quaternion: Floats) -> Floats:
    """Return the rotation matrices of quaternions.

    Args:
        quaternion: wxyz, float32, shape (N, 4); its length does not matter.

    Returns:
        Shape (N, 3, 3), float32; column i is the frame's axis i in the world.
    """
    # Sums of four depend on their order: torch, too, adds one after the other.
    scale = _TWO / np.add.accumulate(quaternion * quaternion, 1)[:, 3:]
    products = (quaternion[:, :, None] * quaternion[:, None, :]).reshape(len(quaternion), 16)
    entries: Floats = scale * (products.take(_FIRST, 1) + _SIGN * products.take(_SECOND, 1))
    entries[:, ::4] = _ONE - entries[:, ::4]
    return entries.reshape(len(quaternion), 3, 3)


def last_euler_angle(matrix: Floats) -> Floats:
    """Return the third of the angles by which turning about x, then y, then z gives a rotation.

    The turns are about the axes of the frame being turned ("XYZ" in native's words).

    Args:
        matrix: Rotation matrices, shape (N, 3, 3).

    Returns:
        Angle in (-π, π], shape (N,) (rad).
    """
    return arctan2(-matrix[:, 0, 1], matrix[:, 0, 0])


def upright(quaternion: Row) -> Row:
    """Return a quaternion with w ≥ 0."""
    w, x, y, z = quaternion
    return (-w, -x, -y, -z) if w < _NOTHING else quaternion


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
