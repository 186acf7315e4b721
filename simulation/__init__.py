"""Worlds of a layout's robots plus objects: physics settings, control, contacts, pictures.

The only room that imports sapien, which lives in `simulation.sapien3`, below the seam that
`simulation.backend` describes.
"""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts")

from simulation.physics import SAPIEN_DEFAULTS, Friction, PhysicsSettings
from simulation.sapien3.plain_scene import build_scene
from simulation.scene.cameras import Camera
from simulation.scene.shapes import Box, Capsule, Cylinder, Mesh, Plane, Shape, Sphere
from simulation.simulation import Simulation
from simulation.state import State
from simulation.tabletop import add_table
from simulation.world import World

__all__ = [
    "SAPIEN_DEFAULTS",
    "Box",
    "Camera",
    "Capsule",
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
    "add_table",
    "build_scene",
]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
