"""What things are: shapes, mass, friction, how they rest, where they are grasped.

A room of its own between robots and layouts: a thing is declared as a robot is, without a
simulator, and layouts, motions, worlds and tasks may all speak of it.

Importing this package loads neither a simulator nor torch, and touches no file or network.
"""

from robot_layouts.core.own_packages import expect_own

expect_own("robots")

from objects.descriptor import Grasp, NamedPoint, ObjectDescriptor
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


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
