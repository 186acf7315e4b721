"""What is taken as the limits of joints' speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots import RobotDescriptor
from robots.urdf.model import UrdfModel

# Per unit of a joint: the least that is taken for its largest speed, what is taken where the URDF
# has none, and the most (1/s). Wrists of arms turn at 2π rad/s; URDFs also have 0, and 1e6. Fingers
# that slide at 0.2 m/s are light: a hit that harms nothing makes them ten times as fast.
SPEEDS = {"rad": (2.0, 2 * np.pi, 100.0), "m": (0.5, 1.0, 10.0)}


def joint_speeds(descriptor: RobotDescriptor, model: UrdfModel) -> NDArray[np.float32]:
    """Return the largest speed of each joint: the URDF's, where it has one that makes sense."""
    joints = {joint.name: joint for joint in model.moving}
    speeds: list[float] = []
    for joint in (joints[name] for name in descriptor.joints):
        least, usual, most = SPEEDS[joint.unit]
        speeds.append(min(max(joint.velocity or usual, least), most))
    return np.array(speeds, np.float32)
