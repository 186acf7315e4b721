"""Which way a base faces, told from its quaternion."""

from __future__ import annotations

import math

from robots.descriptor import Quaternion, Vector3


def forward(quaternion: Quaternion) -> Vector3:
    """Return the world direction (unit length) of the +x axis of a frame turned by ``quaternion``.

    Args:
        quaternion: Orientation in the world, wxyz, unit length.
    """
    w, x, y, z = quaternion
    return (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))


def upward(quaternion: Quaternion) -> Vector3:
    """Return the world direction (unit length) of the +z axis of a frame turned by ``quaternion``.

    Args:
        quaternion: Orientation in the world, wxyz, unit length.
    """
    w, x, y, z = quaternion
    return (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))


def yaw_degrees(quaternion: Quaternion) -> float | None:
    """Return the turn about the world's z axis (degrees), or None if the frame also tilts.

    Args:
        quaternion: Orientation in the world, wxyz, unit length.
    """
    if upward(quaternion)[2] < 1 - 1e-9:
        return None
    x, y, _ = forward(quaternion)
    return math.degrees(math.atan2(y, x))
