"""Products, inverses and angles of poses, in the order of operations of native's ``Pose``.

Poses are position (m) and quaternion (wxyz), float32, (N, 7). Quaternions are products of NumPy,
which adds and multiplies exactly as torch does and costs less per call; roots and angles are
torch's.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.linalg import vector_norm

Floats = NDArray[np.float32]

# Component j of a product is the sum over k of a[k] · b[_FACTOR[k, j]] · _SIGN[k, j], k = 0 first.
_FACTOR = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGN = np.array([[1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1]], np.float32)
_CONJUGATE = np.array([1, -1, -1, -1], np.float32)

_SMALL_ANGLE = 1e-6  # below it sin(x / 2) / x is taken from its series (rad)


def compose(first: Tensor, second: Tensor) -> Tensor:
    """Return the pose that ``second`` has in the world if ``first`` is the frame it is given in.

    Args:
        first: Shape (N, 7).
        second: Shape (N, 7) or (1, 7).

    Returns:
        Shape (N, 7), with w ≥ 0.
    """
    a, b = first.numpy(), second.numpy()
    pose = np.empty(a.shape, np.float32)
    pose[:, :3] = a[:, :3] + _rotated(a[:, 3:], b[:, :3])
    pose[:, 3:] = _with_positive_w(_product(a[:, 3:], b[:, 3:]))
    return torch.from_numpy(pose)


def inverse(pose: Tensor) -> Tensor:
    """Return the inverse of poses, shape (N, 7)."""
    a = pose.numpy()
    inverted = np.empty(a.shape, np.float32)
    inverted[:, 3:] = a[:, 3:] * _CONJUGATE
    inverted[:, :3] = _rotated(inverted[:, 3:], -a[:, :3])
    return torch.from_numpy(inverted)


def transform(pose: Tensor, point: Tensor) -> Tensor:
    """Return points that are given in the frame ``pose`` in the frame of ``pose``, (N, 3) (m).

    Args:
        pose: Shape (N, 7).
        point: Shape (N, 3) or (1, 3) (m).
    """
    a = pose.numpy()
    return torch.from_numpy(a[:, :3] + _rotated(a[:, 3:], point.numpy()))


def angle_between(first: Tensor, second: Tensor) -> Tensor:
    """Return the angle by which quaternions (N, 4) differ, shape (N,), in [0, π] (rad).

    Native takes the length of the axis-angle vector, which differs from the angle by rounding.
    """
    a, b = first.numpy(), second.numpy()
    turn = torch.from_numpy(_with_positive_w(_product(a * _CONJUGATE, b)))
    axis = turn[:, 1:]
    half_angle = _half_angle(vector_norm(axis, dim=-1, keepdim=True), turn[:, :1])
    angle = 2 * half_angle
    ratio = torch.where(
        angle.abs() < _SMALL_ANGLE, 0.5 - (angle * angle) / 48, half_angle.sin() / angle
    )
    turned = vector_norm(axis / ratio, dim=1)
    return torch.minimum(turned, 2 * math.pi - turned)


def _half_angle(sine: Tensor, cosine: Tensor) -> Tensor:
    """Arc tangent row by row: torch's depends on how many are computed together."""
    rows = zip(sine.unbind(), cosine.unbind(), strict=True)
    return torch.stack([torch.atan2(y, x) for y, x in rows])


def _product(a: Floats, b: Floats) -> Floats:
    """Products of quaternions, (N, 4)."""
    factors: Floats = b.take(_FACTOR, 1) * _SIGN
    terms: Floats = a[:, :, None] * factors
    return terms[:, 0] + terms[:, 1] + terms[:, 2] + terms[:, 3]


def _rotated(quaternion: Floats, point: Floats) -> Floats:
    """Points (N, 3) turned by quaternions (N, 4)."""
    as_quaternion = np.zeros((len(point), 4), np.float32)
    as_quaternion[:, 1:] = point
    return _product(_product(quaternion, as_quaternion), quaternion * _CONJUGATE)[:, 1:]


def _with_positive_w(quaternion: Floats) -> Floats:
    return np.where(quaternion[:, :1] < 0, -quaternion, quaternion)
