"""Flat tops as solid bodies: what robots stand on, for collision checks."""

from __future__ import annotations

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots.bodies.hulls import Hull, convex_hull


def slab_hull(top: Floats, depth: float, name: str) -> Hull:
    """Return what lies below a flat top, as a body of its own in the world frame.

    Args:
        top: Its corners, (n, 3) (m).
        depth: How far it goes down (m).
        name: Its name, for errors.

    Raises:
        AssetError: If it has no volume.
    """
    return convex_hull(0, np.concatenate([top, top - [0.0, 0.0, depth]]), name)
