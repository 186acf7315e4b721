"""ManiSkill's table and the ground below it, with the table's top at z = 0."""

from __future__ import annotations

from math import cos, pi, sin

from objects.shapes import Box, Floor, Mesh, Plane, Shape
from robot_layouts.simulation.world import World
from robots.assets.locator import GROUND_TEXTURE, TABLE

# mani_skill 3.0.1, utils/scene_builder/table/scene_builder.py (m)
TABLE_HEIGHT = 0.9196429
TABLE_HALF_SIZE = (2.418 / 2, 1.209 / 2, TABLE_HEIGHT / 2)
TABLE_POSITION = (-0.12, 0.0, -TABLE_HEIGHT)
TABLE_QUATERNION = (cos(pi / 4), 0.0, 0.0, sin(pi / 4))  # the long side along y
TABLE_OUTLINE = (  # x_min, y_min, x_max, y_max (m)
    TABLE_POSITION[0] - TABLE_HALF_SIZE[1],
    -TABLE_HALF_SIZE[0],
    TABLE_POSITION[0] + TABLE_HALF_SIZE[1],
    TABLE_HALF_SIZE[0],
)
GROUND_HEIGHT = -(3.5762787e-07 + 0.91964257)  # from the table mesh's bounding box


MESH_SCALE = 1.75
WHITE = (1.0, 1.0, 1.0, 1.0)


def add_table(world: World, *, textured: bool = True) -> None:
    """Add the table (a kinematic body called ``table-workspace``) and the ground.

    The table is kinematic, not static: contacts against a static one are solved differently.

    Args:
        world: The world.
        textured: Whether pictures show wood; else the table is white.

    Raises:
        AssetError: If the world has visuals and their files cannot be found.
    """
    drawn = world.visuals  # a box and a plane stand for mesh and texture where nothing is drawn
    box = Box(
        half_size=TABLE_HALF_SIZE,
        position=(0.0, 0.0, TABLE_HEIGHT / 2),
        color=(0.55, 0.42, 0.32, 1.0),
        visible=not drawn,
    )
    world.add(
        "table-workspace",
        box,
        *(_table_mesh(textured=textured) if drawn else ()),
        kind="kinematic",
        position=TABLE_POSITION,
        quaternion=TABLE_QUATERNION,
        anchored=True,
    )
    plane = Plane(
        position=(0.0, 0.0, GROUND_HEIGHT),
        quaternion=(0.7071068, 0.0, -0.7071068, 0.0),  # plane normal +x turned to +z
        color=(0.35, 0.37, 0.4, 1.0),
        visible=not drawn,
    )
    world.add("ground", plane, *(_floor() if drawn else ()), kind="static")


def _table_mesh(*, textured: bool) -> tuple[Shape]:
    mesh = Mesh(
        file=TABLE.locate(),
        scale=(MESH_SCALE, MESH_SCALE, MESH_SCALE),
        quaternion=TABLE_QUATERNION,
        textured=textured,
        color=WHITE,
        collides=False,
    )
    return (mesh,)


def _floor() -> tuple[Shape]:
    # mani_skill 3.0.1, utils/building/ground.py
    texture = GROUND_TEXTURE.locate()
    return (Floor(texture=texture, position=(0.0, 0.0, GROUND_HEIGHT)),)
