"""Rotations and poses of any number of frames at once, as NumPy arrays.

Quaternions are wxyz, unit length, (…, 4); rotation matrices (…, 3, 3), whose columns are the axes
of the turned frame; poses homogeneous matrices, (…, 4, 4) (m). Leading axes broadcast.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.kinematics import quaternions

Floats = NDArray[np.float64]

_SMALL_ANGLE = 1e-3  # below it x / sin(x / 2) is taken from its series (rad)


def multiply(first: ArrayLike, second: ArrayLike) -> Floats:
    """Return quaternions that turn by ``second`` and then by ``first``, (…, 4)."""
    return _stacked(quaternions.multiplied(_components(first), _components(second)))


def inverse(quaternion: ArrayLike) -> Floats:
    """Return the quaternions that undo others, (…, 4)."""
    return _stacked(quaternions.inverted(_components(quaternion)))


def rotate(quaternion: ArrayLike, vector: ArrayLike) -> Floats:
    """Return vectors turned by quaternions, (…, 3)."""
    return _stacked(quaternions.rotated(_components(quaternion), _components(vector)))


def quaternion_about(axis: Sequence[float], angle: ArrayLike) -> Floats:
    """Return the quaternions of turns about an axis, (…, 4).

    Args:
        axis: Unit length, (3,).
        angle: (…) (rad).
    """
    half = np.asarray(angle, float) / 2
    return np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * np.array(axis)], -1)


def quaternion_of(rotation: ArrayLike) -> Floats:
    """Return the quaternions of rotation matrices, with w ≥ 0, (…, 4).

    Of the four ways to read one off, it takes the one that divides by the largest component.
    """
    matrix = np.asarray(rotation, float)
    xx, yy, zz = (matrix[..., i, i] for i in range(3))
    trace = xx + yy + zz
    x, y, z = (matrix[..., i, j] - matrix[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0)))
    xy, xz, yz = (matrix[..., i, j] + matrix[..., j, i] for i, j in ((1, 0), (2, 0), (2, 1)))
    # Row i is the quaternion times four times its component i.
    rows = np.stack(
        [
            _stacked((1 + trace, x, y, z)),
            _stacked((x, 1 - trace + 2 * xx, xy, xz)),
            _stacked((y, xy, 1 - trace + 2 * yy, yz)),
            _stacked((z, xz, yz, 1 - trace + 2 * zz)),
        ],
        axis=-2,
    )
    largest = np.argmax(_stacked((trace, xx, yy, zz)), axis=-1)
    row = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    w, x, y, z = _components(row)
    unit = row / np.sqrt(x * x + y * y + z * z + w * w)[..., None]
    return np.where(unit[..., :1] < 0, -unit, unit)


def _quaternion_of_one(matrix: Sequence[float]) -> tuple[float, float, float, float]:
    """Return what `quaternion_of` does, to the last bit, of one matrix in rows, (9,)."""
    xx, m01, m02, m10, yy, m12, m20, m21, zz = matrix
    trace = xx + yy + zz
    x, y, z = m21 - m12, m02 - m20, m10 - m01
    xy, xz, yz = m01 + m10, m02 + m20, m12 + m21
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        w, x, y, z = 1 + trace, x, y, z
    elif largest == xx:
        w, x, y, z = x, 1 - trace + 2 * xx, xy, xz
    elif largest == yy:
        w, x, y, z = y, xy, 1 - trace + 2 * yy, yz
    else:
        w, x, y, z = z, xz, yz, 1 - trace + 2 * zz
    length = sqrt(x * x + y * y + z * z + w * w)
    if w < 0:
        length = -length
    return w / length, x / length, y / length, z / length


def rotation_of(quaternion: ArrayLike) -> Floats:
    """Return the rotation matrices of quaternions, (…, 3, 3)."""
    array = np.asarray(quaternion, float)
    single = array.ndim == 1
    w, x, y, z = array.tolist() if single else _components(array)  # numbers are quicker than arrays
    entries = (
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    if single:
        return np.array(entries).reshape(3, 3)
    return np.stack(entries, axis=-1).reshape(*np.shape(w), 3, 3)


def rotation_about(axis: Sequence[float], angle: ArrayLike) -> Floats:
    """Return the rotation matrices of turns about an axis, (…, 3, 3).

    Args:
        axis: Unit length, (3,).
        angle: (…) (rad).
    """
    unit, first, second = _turning(*axis)
    angles = np.asarray(angle, float)[..., None, None]
    return unit + np.sin(angles) * first + (1 - np.cos(angles)) * second


@lru_cache(1024)
def _turning(x: float, y: float, z: float) -> tuple[Floats, Floats, Floats]:
    """Return what rotation matrices about an axis are made of: powers of its cross product."""
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float)
    return np.eye(3), cross, cross @ cross


def cross(first: Floats, second: Floats) -> Floats:
    """Return cross products, (…, 3): NumPy's to the last bit, but of few vectors much sooner."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return first[..., ahead] * second[..., behind] - first[..., behind] * second[..., ahead]


def rotation_vector(rotation: ArrayLike) -> Floats:
    """Return axis times angle of rotation matrices, the angle in [0, π], (…, 3) (rad)."""
    matrices = np.asarray(rotation, float)
    if matrices.size == 9:  # numbers are quicker than arrays
        quaternion = np.array(_quaternion_of_one(matrices.reshape(9).tolist()))
        quaternion = quaternion.reshape(*matrices.shape[:-2], 4)
    else:
        quaternion = quaternion_of(matrices)
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    angle = 2 * np.arctan2(np.linalg.norm(axis, axis=-1, keepdims=True), w)
    small = angle <= _SMALL_ANGLE
    series = 2 + angle**2 / 12 + 7 * angle**4 / 2880
    return axis * np.where(small, series, angle / np.sin(np.where(small, 1.0, angle) / 2))


def xyz_angles(quaternion: ArrayLike) -> Floats:
    """Return the turns about x, then the turned y, then the turned z of a rotation, (3,) (rad).

    Args:
        quaternion: wxyz, unit length, (4,).
    """
    matrix = rotation_of(quaternion)
    return np.array(
        [
            np.arctan2(-matrix[1, 2], matrix[2, 2]),
            np.arcsin(np.clip(matrix[0, 2], -1, 1)),
            np.arctan2(-matrix[0, 1], matrix[0, 0]),
        ]
    )


def pose_matrix(position: ArrayLike, quaternion: ArrayLike) -> Floats:
    """Return poses as matrices, (…, 4, 4).

    Args:
        position: (…, 3) (m).
        quaternion: wxyz, unit length, (…, 4).
    """
    rotation, position = rotation_of(quaternion), np.asarray(position, float)
    pose = np.zeros((*np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1]), 4, 4))
    pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = rotation, position, 1.0
    return pose


def rpy_pose(position: ArrayLike, rpy: Sequence[float]) -> Floats:
    """Return the pose that a URDF's origin describes, (4, 4).

    Args:
        position: (3,) (m).
        rpy: Turns about the fixed axes x, y and z, in that order, (3,) (rad).
    """
    pose = np.eye(4)
    for axis, angle in zip(np.eye(3).tolist(), rpy, strict=True):
        pose[:3, :3] = rotation_about(axis, angle) @ pose[:3, :3]
    pose[:3, 3] = position
    return pose


def inverse_pose(pose: Floats) -> Floats:
    """Return the poses of the surrounding frame in the frames that poses describe, (…, 4, 4)."""
    back = np.swapaxes(pose[..., :3, :3], -1, -2)
    undone = np.zeros_like(pose)
    undone[..., :3, :3], undone[..., 3, 3] = back, 1.0
    undone[..., :3, 3] = -(back @ pose[..., :3, 3, None])[..., 0]
    return undone


def transform(pose: Floats, point: ArrayLike) -> Floats:
    """Return points that are given in the frames of poses in the surrounding frame, (…, 3) (m)."""
    return (pose[..., :3, :3] @ np.asarray(point, float)[..., None])[..., 0] + pose[..., :3, 3]


def _components(array: ArrayLike) -> tuple[Any, ...]:
    return tuple(np.moveaxis(np.asarray(array, float), -1, 0))


def _stacked(components: Sequence[Any]) -> Floats:
    return np.stack(np.broadcast_arrays(*components), axis=-1)
