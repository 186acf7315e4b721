"""Where robots stand whose bases are off their placements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from layouts import Layout
from robot_layouts.kinematics.quaternions import multiplied, yaw_quaternion


def shifted(layout: Layout, shifts: Mapping[str, Mapping[str, float]]) -> Layout:
    """Return a layout whose robots stand off their placements; what hangs on them follows.

    Args:
        layout: As it was declared.
        shifts: By robot: ``x``, ``y``, ``z`` (m) and ``yaw`` (rad), as far as they vary.
    """
    placements = dict(layout)
    for name, shift in shifts.items():
        pose = layout[name].local_pose
        x, y, z = (a + shift.get(axis, 0.0) for a, axis in zip(pose.position, "xyz", strict=True))
        turned = pose.quaternion
        if yaw := shift.get("yaw", 0.0):
            turned = multiplied(yaw_quaternion(yaw), turned)
        placements[name] = replace(layout[name], position=(x, y, z), quaternion=turned, rpy=None)
    return Layout(placements, layout.frames)
