"""What a robot is, and where its files come from.

Importing this package loads neither a simulator nor torch, and touches no file or network.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any

from robot_layouts.core.errors import (
    ActionError,
    AssetError,
    DescriptorError,
    DivergedError,
    LayoutError,
    MissingPackageError,
    RecordingError,
    RobotLayoutsError,
    SimulationError,
    TaskError,
    UnknownNameError,
    UnreadableFileError,
    closest_match,
    unknown_name_message,
)
from robot_layouts.core.portable import is_portable
from robots.assets.locator import LocalUrdf, UrdfLocator
from robots.descriptor import (
    CONTROL_MODES,
    ActionNumber,
    ActionSplit,
    CameraMount,
    Fingers,
    FromMjcf,
    FromUrdf,
    GripperMaterial,
    Home,
    JointGroup,
    Limb,
    NativeAgent,
    RobotDescriptor,
    WithGripper,
)
from robots.mjcf.locator import LocalMjcf
from robots.registry import RobotRegistry

__all__ = [
    "CONTROL_MODES",
    "ActionError",
    "ActionNumber",
    "ActionSplit",
    "AssetError",
    "CameraMount",
    "DescriptorError",
    "DivergedError",
    "Fingers",
    "GripperMaterial",
    "Home",
    "JointGroup",
    "LayoutError",
    "Limb",
    "LocalMjcf",
    "LocalUrdf",
    "MissingPackageError",
    "NativeAgent",
    "RecordingError",
    "RobotDescriptor",
    "RobotLayoutsError",
    "RobotRegistry",
    "SimulationError",
    "TaskError",
    "UnknownNameError",
    "UnreadableFileError",
    "UrdfLocator",
    "closest_match",
    "is_portable",
    "unknown_name_message",
]


def _from_urdf(
    path_or_name: str | os.PathLike[str],
    name: str | None = None,
    *,
    quiet: bool = False,
    xacro: Mapping[str, object] | None = None,
    srdf: str | os.PathLike[str] | None = None,
    folder: str | os.PathLike[str] | None = None,
    **overrides: Any,
) -> RobotDescriptor:
    from robots.from_urdf import guess_descriptor

    found = guess_descriptor(path_or_name, name, xacro=xacro, srdf=srdf, folder=folder, **overrides)
    if not quiet:
        print(found, file=sys.stderr)
    return found.descriptor


def _from_mjcf(
    path_or_name: str | os.PathLike[str],
    name: str | None = None,
    *,
    quiet: bool = False,
    folder: str | os.PathLike[str] | None = None,
    **overrides: Any,
) -> RobotDescriptor:
    return _from_urdf(path_or_name, name, quiet=quiet, form="mjcf", folder=folder, **overrides)


def _with_gripper(
    self: RobotDescriptor, gripper: RobotDescriptor | str | os.PathLike[str], **details: Any
) -> RobotDescriptor:
    from robots.grafting import with_gripper

    return with_gripper(self, gripper, **details)


_from_urdf.__doc__ = FromUrdf.__call__.__doc__
_from_mjcf.__doc__ = FromMjcf.__call__.__doc__
_with_gripper.__doc__ = WithGripper.__call__.__doc__
RobotDescriptor.from_urdf = staticmethod(_from_urdf)
RobotDescriptor.from_mjcf = staticmethod(_from_mjcf)
RobotDescriptor.with_gripper = _with_gripper  # pyright: ignore[reportAttributeAccessIssue]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
