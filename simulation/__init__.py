"""A SAPIEN world: a layout's robots plus objects, physics settings, control, contacts.

The only room that imports sapien.
"""

from simulation.physics import SAPIEN_DEFAULTS, Friction, PhysicsSettings
from simulation.rendering.cameras import Camera
from simulation.scene import build_scene
from simulation.shapes import Box, Capsule, Cylinder, Mesh, Plane, Shape, Sphere
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
