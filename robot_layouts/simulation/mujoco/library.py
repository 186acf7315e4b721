"""The package mujoco, which need not be installed."""

from robot_layouts.core.importing import optional

mujoco = optional("mujoco", "simulator='mujoco' needs MuJoCo", "mujoco")
"""The package.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""
