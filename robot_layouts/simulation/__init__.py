"""Worlds of a layout's robots plus objects: physics settings, control, contacts, pictures.

The only room that imports simulators, each in a folder of its own, below the seam that
`robot_layouts.simulation.backend` describes; importing the room loads none of them.
"""

from typing import TYPE_CHECKING, Any

from robot_layouts.core.errors import missing_name
from robot_layouts.core.own_packages import expect_own

expect_own("robots", "objects", "layouts")

from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Plane, Shape, Sphere
from robot_layouts.simulation.cameras import Camera
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS, Friction, PhysicsSettings
from robot_layouts.simulation.simulation import Simulation
from robot_layouts.simulation.state import State
from robot_layouts.simulation.world import World, add_ground, add_table

if TYPE_CHECKING:
    from robot_layouts.simulation.sapien3.world import build_scene

__all__ = [
    "SAPIEN_DEFAULTS",
    "Box",
    "Camera",
    "Capsule",
    "ConvexHull",
    "Cylinder",
    "Friction",
    "Mesh",
    "PhysicsSettings",
    "Plane",
    "Shape",
    "Simulation",
    "Sphere",
    "State",
    "World",
    "add_ground",
    "add_table",
    "build_scene",
]


def __getattr__(name: str) -> Any:
    """Load SAPIEN where its scene is asked for."""
    if name != "build_scene":
        raise missing_name(__name__, name, __all__)
    from robot_layouts.simulation.sapien3.world import build_scene

    return build_scene


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
