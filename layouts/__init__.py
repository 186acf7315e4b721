"""Which robots stand where: placements, presets, checks and pictures."""

from robot_layouts.core.own_packages import expect_own

expect_own("robots")

from layouts.frames import Frame, Pose, ceiling, table, wall
from layouts.layout import Layout
from layouts.maniskill import from_maniskill
from layouts.placement import Placement
from layouts.placing import search
from layouts.presets import around_table, face_to_face, grid, ring, side_by_side, single
from layouts.standing import at_task
from robot_layouts.kinematics.quaternions import rpy_quaternion, yaw_quaternion

__all__ = [
    "Frame",
    "Layout",
    "Placement",
    "Pose",
    "around_table",
    "at_task",
    "ceiling",
    "face_to_face",
    "from_maniskill",
    "grid",
    "ring",
    "rpy_quaternion",
    "search",
    "side_by_side",
    "single",
    "table",
    "wall",
    "yaw_quaternion",
]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
