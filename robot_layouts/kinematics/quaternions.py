"""Rotations as wxyz quaternions of plain numbers, without NumPy.

Every function takes and returns tuples. The products also take tuples of arrays, one array for each
component, which is how `robot_layouts.kinematics.rotations` multiplies batches.
"""

from __future__ import annotations

import math
from typing import Any

Quaternion = tuple[float, float, float, float]
Vector3 = tuple[float, float, float]


def multiplied(first: Any, second: Any) -> Any:
    """Return the rotation that turns by ``second`` and then by ``first`` (both wxyz)."""
    a, b, c, d = first
    w, x, y, z = second
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def inverted(quaternion: Any) -> Any:
    """Return the rotation that undoes ``quaternion`` (wxyz, unit length)."""
    w, x, y, z = quaternion
    return (w, -x, -y, -z)


def rotated(quaternion: Any, vector: Any) -> Any:
    """Return ``vector`` turned by ``quaternion`` (wxyz, unit length)."""
    w, x, y, z = quaternion
    return multiplied(multiplied(quaternion, (0.0, *vector)), (w, -x, -y, -z))[1:]


def normalised(quaternion: Quaternion) -> Quaternion:
    """Return a wxyz quaternion scaled to length 1."""
    length = math.hypot(*quaternion)
    w, x, y, z = quaternion
    return (w / length, x / length, y / length, z / length)


def forward(quaternion: Quaternion) -> Vector3:
    """Return the direction (unit length) of the +x axis of a frame turned by ``quaternion``."""
    w, x, y, z = quaternion
    return (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))


def upward(quaternion: Quaternion) -> Vector3:
    """Return the direction (unit length) of the +z axis of a frame turned by ``quaternion``."""
    w, x, y, z = quaternion
    return (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))


def yaw_degrees(quaternion: Quaternion) -> float | None:
    """Return the turn about the z axis (degrees), or None if the frame also tilts."""
    if upward(quaternion)[2] < 1 - 1e-9:
        return None
    x, y, _ = forward(quaternion)
    return math.degrees(math.atan2(y, x))


def turn(axis: str, angle: float) -> Quaternion:
    """Return the wxyz quaternion of a turn by ``angle`` (rad) about ``"x"``, ``"y"`` or ``"z"``."""
    sine = math.sin(angle / 2)
    along = {"x": (sine, 0.0, 0.0), "y": (0.0, sine, 0.0), "z": (0.0, 0.0, sine)}
    return (math.cos(angle / 2), *along[axis])


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return the wxyz quaternion of a rotation by ``yaw`` (rad) about z."""
    return (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))


def rpy_quaternion(rpy: Vector3) -> Quaternion:
    """Return the wxyz quaternion of roll, pitch and yaw (rad).

    As in a URDF, the frame turns about the fixed axes x, y and z, in that order.
    """
    roll, pitch, yaw = rpy
    return multiplied(turn("z", yaw), multiplied(turn("y", pitch), turn("x", roll)))


def quaternion_rpy(quaternion: Quaternion) -> Vector3:
    """Return roll, pitch and yaw (rad) of a rotation, as a URDF means them.

    Where the pitch is a right angle, only roll ± yaw matters, and the roll is 0.
    """
    w, x, y, z = quaternion
    cos_yaw, sin_yaw = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)  # times cos(pitch)
    cos_pitch = math.hypot(cos_yaw, sin_yaw)
    pitch = math.atan2(2 * (w * y - x * z), cos_pitch)
    if cos_pitch < 1e-7:
        return (0.0, pitch, math.atan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z)))
    roll = math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    return (roll, pitch, math.atan2(sin_yaw, cos_yaw))
