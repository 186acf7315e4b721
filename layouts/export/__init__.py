"""A layout for other programs: URDF, Drake's directives, MJCF, USD, and a ROS 2 package."""

from layouts.export.drake import write_drake
from layouts.export.mjcf import write_mjcf
from layouts.export.ros2 import write_ros2
from layouts.export.urdf import write_urdf
from layouts.export.usd import write_usd

__all__ = ["write_drake", "write_mjcf", "write_ros2", "write_urdf", "write_usd"]
