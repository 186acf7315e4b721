"""Arithmetic on batches of poses in native's order of operations, which decides the last bits.

It stands apart from `kinematics.rotations`, which computes in double precision. Poses are position
(m) and quaternion (wxyz), float32, (n, 7).
"""

from __future__ import annotations

import numpy as np

from simulation.maths import Floats, cos, norm, sin, sqrt

# Of a product of quaternions a · b: entry j is the sum over k of a[k] · SIGNS[k, j] · b[MET[k, j]].
_MET = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGNS = np.array([[1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1]], np.float32)
_CONJUGATE = np.array([1, -1, -1, -1], np.float32)

# Of a matrix that turns about x, y and z: each entry, row by row, is a sum of two products of cx,
# cy, cz, sx, sy, sz, sx · sy, cx · sy, 1, 0.
_FACTORS = np.array(
    [
        [[1, 2], [1, 5], [4, 8], [6, 2], [6, 5], [3, 1], [7, 2], [7, 5], [0, 1]],
        [[9, 9], [9, 9], [9, 9], [0, 5], [0, 2], [9, 9], [3, 5], [3, 2], [9, 9]],
    ]
)
_FACTOR_SIGNS = np.array([[1, -1, 1, 1, -1, -1, -1, 1, 1], [1, 1, 1, 1, 1, 1, 1, 1, 1]], np.float32)

# Of a quaternion of a matrix: the diagonal's signs, then how the rest is read off.
_DIAGONAL = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float32)
_FIRST = np.array([[0, 7, 2, 3], [7, 0, 3, 2], [2, 3, 0, 7], [3, 2, 7, 0]])
_SECOND = np.array([[0, 5, 6, 1], [5, 0, 1, 6], [6, 1, 0, 5], [1, 6, 5, 0]])
_SECOND_SIGNS = np.array([[1, -1, -1, -1], [-1, 1, 1, 1], [-1, 1, 1, 1], [-1, 1, 1, 1]], np.float32)
_LEAST_ROOT = np.float32(0.1)
_TWO, _ONE = np.float32(2), np.float32(1)


def product(a: Floats, b: Floats) -> Floats:
    """Return products of quaternions, (n, 4); of either sign."""
    factors: Floats = b[:, _MET] * _SIGNS
    terms: Floats = a[:, :, None] * factors
    return terms[:, 0] + terms[:, 1] + terms[:, 2] + terms[:, 3]


def upright(quaternions: Floats) -> Floats:
    """Return quaternions with w ≥ 0, (n, 4)."""
    return np.where(quaternions[:, :1] < 0, -quaternions, quaternions)


def turned(quaternions: Floats, points: Floats) -> Floats:
    """Return points, (n, 3), turned by quaternions."""
    extended = np.zeros((len(points), 4), np.float32)
    extended[:, 1:] = points
    return product(product(quaternions, extended), quaternions * _CONJUGATE)[:, 1:]


def inverse(poses: Floats) -> Floats:
    """Return the inverses of poses."""
    quaternions = poses[:, 3:] * _CONJUGATE
    return np.concatenate([turned(quaternions, -poses[:, :3]), quaternions], 1)


def combined(first: Floats, second: Floats) -> Floats:
    """Return ``first · second``: poses ``second`` of what is seen from ``first``."""
    places = first[:, :3] + turned(first[:, 3:], second[:, :3])
    return np.concatenate([places, upright(product(first[:, 3:], second[:, 3:]))], 1)


def rotation(angles: Floats) -> Floats:
    """Return quaternions, w ≥ 0, of turns about x, then the turned y, then the turned z, (n, 3)."""
    count = len(angles)
    numbers = np.empty((count, 10), np.float32)
    numbers[:, :3], numbers[:, 3:6] = cos(angles), sin(angles)
    np.multiply(numbers[:, 3], numbers[:, 4], out=numbers[:, 6])
    np.multiply(numbers[:, 0], numbers[:, 4], out=numbers[:, 7])
    numbers[:, 8], numbers[:, 9] = 1.0, 0.0
    factors = numbers[:, _FACTORS]
    products: Floats = factors[..., 0] * factors[..., 1] * _FACTOR_SIGNS
    return quaternion(products[:, 0] + products[:, 1])


def quaternion(matrices: Floats) -> Floats:
    """Return the quaternions, w ≥ 0, of rotation matrices row by row, (n, 9)."""
    signed = matrices[:, None, ::4] * _DIAGONAL
    squares = _ONE + signed[..., 0] + signed[..., 1] + signed[..., 2]
    roots = sqrt(np.maximum(squares, 0))
    best = roots.argmax(1)
    rows = np.arange(len(matrices))
    root = roots[rows, best]
    first, second = _FIRST[best], _SECOND[best]
    taken = rows[:, None]
    found = matrices[taken, first] + _SECOND_SIGNS[best] * matrices[taken, second]
    found[rows, best] = root * root
    return upright(found / (_TWO * np.maximum(root, _LEAST_ROOT))[:, None])


def clipped_turn(angles: Floats) -> Floats:
    """Return angles, (n, 3), those whose norm is above 1 scaled down to 1."""
    lengths = norm(angles)
    far = lengths > 1
    if not far.any():
        return angles
    return np.where(far[:, None], angles * (_ONE / lengths)[:, None], angles)
