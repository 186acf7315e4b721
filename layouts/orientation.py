"""Rotations as wxyz quaternions, and which way a base faces."""

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


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return the wxyz quaternion of a rotation by ``yaw`` (rad) about z."""
    return (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))


def rpy_quaternion(rpy: Vector3) -> Quaternion:
    """Return the wxyz quaternion of roll, pitch and yaw (rad).

    As in a URDF, the frame turns about the fixed axes x, y and z, in that order.
    """
    roll, pitch, yaw = rpy
    about_x = (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    about_y = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    return multiplied(yaw_quaternion(yaw), multiplied(about_y, about_x))


def multiplied(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation that turns by ``second`` and then by ``first`` (both wxyz)."""
    a, b, c, d = first
    w, x, y, z = second
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def inverted(quaternion: Quaternion) -> Quaternion:
    """Return the rotation that undoes ``quaternion`` (wxyz, unit length)."""
    w, x, y, z = quaternion
    return (w, -x, -y, -z)


def normalised(quaternion: Quaternion) -> Quaternion:
    """Return a wxyz quaternion scaled to length 1."""
    length = math.hypot(*quaternion)
    w, x, y, z = quaternion
    return (w / length, x / length, y / length, z / length)


def rotated(quaternion: Quaternion, vector: Vector3) -> Vector3:
    """Return ``vector`` turned by ``quaternion`` (wxyz, unit length)."""
    _, x, y, z = multiplied(multiplied(quaternion, (0.0, *vector)), inverted(quaternion))
    return (x, y, z)
