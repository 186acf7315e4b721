"""Rotations as native computes them, to the last bit."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from robots.descriptor import Quaternion


def along_ray(angle: float, distance: float) -> tuple[tuple[float, float], Quaternion]:
    """Return a place on a ray from the origin, and how what lies along the ray is turned.

    It rounds as ``sapien.Pose.set_rpy`` and the product of two poses: in float32, with the C
    library's cosine and sine. NumPy takes these for complex numbers; for others it has its own.

    Args:
        angle: Of the ray, about z (rad).
        distance: Along it (m).

    Returns:
        x and y (m), and a quaternion (wxyz).
    """
    half = np.exp(np.complex64(1j * float(np.float32(angle) / np.float32(2))))
    cosine, sine, far = half.real, half.imag, np.float32(distance)
    x = far * (cosine * cosine - sine * sine)
    y = np.float32(2) * (sine * far) * cosine
    return (float(x), float(y)), (float(cosine), 0.0, 0.0, float(sine))


def about_z(angle: Tensor) -> Tensor:
    """Return a rotation about z, wxyz (4,), by the operations of ``axis_angle_to_quaternion``.

    Args:
        angle: Shape (1,), more than 1e-6 (rad).
    """
    turn = torch.cat((torch.zeros(2), angle))
    size = torch.linalg.vector_norm(turn, dim=-1, keepdim=True)
    half = size * 0.5
    return torch.cat((torch.cos(half), turn * (torch.sin(half) / size)))
