"""MuJoCo behind the seam, and the package mujoco, which need not be installed."""

import os
import sys

from robot_layouts.core.importing import optional

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")  # it chooses what draws when it is imported

mujoco = optional("mujoco", "simulator='mujoco' needs MuJoCo", "mujoco")
"""The package.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""
