"""Bodies that several tasks put into their worlds."""

from __future__ import annotations

from math import cos, pi, sin

from robots.descriptor import Vector3
from simulation import Box, Cylinder, Sphere, World
from simulation.shapes import Color

RED: Color = (1.0, 0.0, 0.0, 1.0)
GREEN: Color = (0.0, 1.0, 0.0, 1.0)
BLUE: Color = (0.0, 0.0, 1.0, 1.0)
# mani_skill 3.0.1, utils/building/actors/common.py and the tasks that use them
WHITE: Color = (1.0, 1.0, 1.0, 1.0)
TARGET_RED: Color = (194 / 255, 19 / 255, 22 / 255, 1.0)
DARK_BLUE: Color = (12 / 255, 42 / 255, 160 / 255, 1.0)
DARK_RED: Color = (176 / 255, 14 / 255, 14 / 255, 1.0)

TARGET_HEIGHT = 1e-3  # of a target's middle above the table (m)
FACE_UP = (cos(pi / 4), 0.0, sin(pi / 4), 0.0)  # wxyz; turns a disc's axis from x to z


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


def add_target(world: World, radius: float, name: str = "goal_region") -> None:
    """Add a disc of red and white rings that marks a place and touches nothing.

    Its axis is its own x axis; `FACE_UP` lays it down.

    Args:
        world: The world.
        radius: Its radius (m).
        name: Its name.
    """
    rings = [
        Cylinder(
            radius=radius * (5 - i) / 5,
            half_length=(0.5 + i) * 1e-5,  # the inner ones stand out, so that they are seen
            color=WHITE if i % 2 else TARGET_RED,
            collides=False,
        )
        for i in range(5)
    ]
    world.add(name, *rings, kind="kinematic")
