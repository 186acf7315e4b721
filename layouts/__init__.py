"""Which robots stand where: placements, presets, checks and pictures."""

from layouts.layout import Layout, Placement
from layouts.presets import face_to_face, side_by_side, single, yaw_quaternion

__all__ = ["Layout", "Placement", "face_to_face", "side_by_side", "single", "yaw_quaternion"]
