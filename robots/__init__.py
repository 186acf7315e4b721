"""What a robot is, and where its files come from.

Importing this package loads neither a simulator nor torch, and touches no file or network.
"""

from robots.assets.locator import LocalUrdf, UrdfLocator
from robots.common.errors import (
    ActionError,
    AssetError,
    DescriptorError,
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
from robots.common.portable import is_portable
from robots.descriptor import (
    CONTROL_MODES,
    ActionNumber,
    ActionSplit,
    CameraMount,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    Limb,
    NativeAgent,
    RobotDescriptor,
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


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
