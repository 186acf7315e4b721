"""ManiSkill's table and the ground below it, with the table's top at z = 0."""

from __future__ import annotations

from math import cos, pi, sin

from simulation.shapes import Box, Plane
from simulation.world import World

# mani_skill 3.0.1, utils/scene_builder/table/scene_builder.py (m)
TABLE_HEIGHT = 0.9196429
TABLE_HALF_SIZE = (2.418 / 2, 1.209 / 2, TABLE_HEIGHT / 2)
TABLE_POSITION = (-0.12, 0.0, -TABLE_HEIGHT)
TABLE_QUATERNION = (cos(pi / 4), 0.0, 0.0, sin(pi / 4))  # the long side along y
GROUND_HEIGHT = -(3.5762787e-07 + 0.91964257)  # from the table mesh's bounding box


def add_table(world: World) -> None:
    """Add the table (a kinematic body called ``table-workspace``) and the ground.

    The table is kinematic, not static: contacts against a static one are solved differently.
    """
    world.add(
        "table-workspace",
        Box(
            half_size=TABLE_HALF_SIZE,
            position=(0.0, 0.0, TABLE_HEIGHT / 2),
            color=(0.55, 0.42, 0.32, 1.0),
        ),
        kind="kinematic",
        position=TABLE_POSITION,
        quaternion=TABLE_QUATERNION,
        anchored=True,
    )
    world.add(
        "ground",
        Plane(
            position=(0.0, 0.0, GROUND_HEIGHT),
            quaternion=(0.7071068, 0.0, -0.7071068, 0.0),  # plane normal +x turned to +z
            color=(0.35, 0.37, 0.4, 1.0),
        ),
        kind="static",
    )
