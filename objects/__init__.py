"""What things are: shapes, mass, friction, how they rest, where they are grasped.

A room of its own between robots and layouts: a thing is declared as a robot is, without a
simulator, and layouts, motions, worlds and tasks may all speak of it.

Importing this package loads neither a simulator nor torch, and touches no file or network.
"""

from robot_layouts.core.own_packages import expect_own

expect_own("robots")

import os
from typing import Any

from objects.descriptor import Grasp, NamedPoint, ObjectDescriptor, ThingFromMesh, ThingFromMjcf
from objects.family import Family, Made, Size, family
from objects.joints import Joint
from objects.registry import ObjectRegistry

__all__ = [
    "Family",
    "Grasp",
    "Joint",
    "Made",
    "NamedPoint",
    "ObjectDescriptor",
    "ObjectRegistry",
    "Size",
    "family",
]


def _from_mesh(
    path: str | os.PathLike[str], name: str | None = None, **details: Any
) -> ObjectDescriptor:
    from objects.files.mesh import thing_from_mesh

    return thing_from_mesh(path, name, **details)


def _from_mjcf(
    path: str | os.PathLike[str], name: str | None = None, **details: Any
) -> ObjectDescriptor:
    from objects.files.mjcf import thing_from_mjcf

    return thing_from_mjcf(path, name, **details)


_from_mesh.__doc__ = ThingFromMesh.__call__.__doc__
_from_mjcf.__doc__ = ThingFromMjcf.__call__.__doc__
ObjectDescriptor.from_mesh = staticmethod(_from_mesh)
ObjectDescriptor.from_mjcf = staticmethod(_from_mjcf)


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
