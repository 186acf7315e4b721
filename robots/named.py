"""A robot by what a user calls it: a name of the registry, or the path of a URDF or MJCF."""

from __future__ import annotations

import os

from robots.descriptor import RobotDescriptor
from robots.registry import RobotRegistry

_ENDINGS = (".urdf", ".xacro", ".xml", ".mjcf")


def is_path(word: object) -> bool:
    """Return whether a word is the path of a URDF or MJCF, and no name of a robot."""
    if isinstance(word, os.PathLike):
        return True
    if not isinstance(word, str):
        return False
    return word.partition("?")[0].endswith(_ENDINGS) or (os.sep in word and os.path.isfile(word))


def named_robot(word: str | os.PathLike[str]) -> RobotDescriptor:
    """Return the robot of a name, or the one that is guessed from the URDF or MJCF at a path.

    Raises:
        UnknownNameError: If no robot has that name.
        AssetError: If the file or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves in it.
        MissingPackageError: If it is an MJCF, and MuJoCo is not installed.
    """
    if is_path(word):
        return RobotDescriptor.from_urdf(word, quiet=True)
    return RobotRegistry.load(word)  # type: ignore[arg-type]  # which says what it takes
