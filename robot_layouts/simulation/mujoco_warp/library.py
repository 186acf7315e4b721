"""The packages warp and mujoco_warp, which need not be installed."""

from robot_layouts.core.importing import optional

_WHAT = "simulator='mujoco_warp' needs MuJoCo Warp"

warp = optional("warp", _WHAT, "mujoco_warp")
"""What compiles kernels for a device.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""
warp.config.log_level = warp.LOG_ERROR  # it warns where there is no card
warp.init()

mujoco_warp = optional("mujoco_warp", _WHAT, "mujoco_warp")
"""MuJoCo in such kernels.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""
