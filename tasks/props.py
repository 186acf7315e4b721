"""Bodies that several tasks put into their worlds."""

from __future__ import annotations

from robots.descriptor import Vector3
from simulation import Box, Sphere, World
from simulation.shapes import Color

RED: Color = (1.0, 0.0, 0.0, 1.0)
GREEN: Color = (0.0, 1.0, 0.0, 1.0)
BLUE: Color = (0.0, 0.0, 1.0, 1.0)
WHITE: Color = (1.0, 1.0, 1.0, 1.0)


def add_cube(
    world: World, name: str, half_size: float, position: Vector3, color: Color = RED
) -> None:
    """Add a cube that physics moves.

    Args:
        world: The world.
        name: Its name.
        half_size: Half its edge (m).
        position: Where it is built (m).
        color: Its colour.
    """
    cube = Box(half_size=(half_size, half_size, half_size), color=color)
    world.add(name, cube, position=position)


def add_goal(world: World, radius: float, name: str = "goal_site") -> None:
    """Add a green ball that marks a place and touches nothing.

    Args:
        world: The world.
        radius: Its radius (m).
        name: Its name.
    """
    world.add(name, Sphere(radius=radius, color=GREEN, collides=False), kind="kinematic")
