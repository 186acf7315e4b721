"""Headings and grasps as rotations; quaternions are wxyz, angles rad, lengths m."""

from __future__ import annotations

from math import hypot, pi

import numpy as np

from robot_layouts.kinematics import quaternions
from robot_layouts.kinematics.rotations import Floats, multiply, rotate


def turn(axis: str, angle: float) -> Floats:
    """Return the rotation by ``angle`` about ``"x"``, ``"y"`` or ``"z"``, (4,)."""
    return np.array(quaternions.turn(axis, angle))


def backed_off(pose: tuple[Floats, Floats], distance: float) -> tuple[Floats, Floats]:
    """Return the pose that lies ``distance`` (m) behind, against the gripper's approach.

    Args:
        pose: Position (3,) (m) and orientation (4,) of a gripper.
        distance: How far; negative goes ahead (m).
    """
    position, quaternion = pose
    return position - distance * rotate(quaternion, np.array([0.0, 0.0, 1.0])), quaternion


def yaw_of(quaternion: Floats) -> float:
    """Return the heading of a body's own x axis, seen from above."""
    x, y, _ = rotate(quaternion, np.array([1.0, 0.0, 0.0]))
    return float(np.arctan2(y, x))


def heading(origin: Floats, target: Floats) -> float:
    """Return the direction from one point to another, seen from above, as an angle from +x."""
    x, y = (target - origin)[:2]
    return float(np.arctan2(y, x))


def planar_distance(a: Floats, b: Floats) -> float:
    """Return the distance of two points seen from above."""
    return hypot(*(a - b)[:2])


def nearest_quarter_turn(angle: float) -> float:
    """Return the angle of the same square in (-π/4, π/4]: what a cube's yaw amounts to."""
    return angle - round(angle / (pi / 2)) * (pi / 2)


def squared(direction: float, yaw: float) -> float:
    """Return the heading of a cube's side nearest a direction, for a cube of that yaw (rad)."""
    return direction + nearest_quarter_turn(yaw - direction)


def gripper_facing(direction: float, tilt: float) -> Floats:
    """Return the orientation of a gripper that reaches down and forward, (4,).

    Its fingers open level, at a right angle to ``direction``: fingers that are to close along a
    heading take that heading plus or minus π/2. The gripper's own z axis is its approach, its y
    axis the way its fingers open.

    Args:
        direction: Heading in which it leans, from +x (rad).
        tilt: Angle between its approach and straight down (rad); π/2 reaches forward level.
    """
    down = turn("x", pi)
    return multiply(multiply(turn("z", direction), down), turn("y", tilt))
