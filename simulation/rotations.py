"""Rotation matrices and angles of quaternions, with the operations of native's helpers."""

from __future__ import annotations

import numpy as np
import torch

from simulation.arrays import Floats, arctan2

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
_TWO, _ONE = np.float32(2.0), np.float32(1.0)


def rotation_matrix(quaternion: Floats) -> Floats:
    """Return the rotation matrices of quaternions.

    Args:
        quaternion: wxyz, float32, shape (N, 4); its length does not matter.

    Returns:
        Shape (N, 3, 3), float32; column i is the frame's axis i in the world.
    """
    # Sums of four depend on their order, so torch adds.
    scale = _TWO / torch.from_numpy(quaternion * quaternion).sum(-1, keepdim=True).numpy()
    products = (quaternion[:, :, None] * quaternion[:, None, :]).reshape(len(quaternion), 16)
    entries = scale * (products[:, _FIRST] + _SIGN * products[:, _SECOND])
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
