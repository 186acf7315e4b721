"""Bodies that several tasks put into their worlds."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np

from layouts import Layout
from layouts.frames import Rectangle
from objects import ObjectDescriptor, ObjectRegistry
from objects.shapes import Color
from objects.solids import lowest
from robot_layouts.simulation import Box, Cylinder, Mesh, Plane, Shape, Sphere, World, add_ground
from robot_layouts.simulation.world import BodyKind
from robots.assets.locator import KITCHEN_COUNTER
from robots.descriptor import Quaternion, Vector3

RED: Color = (1.0, 0.0, 0.0, 1.0)
GREEN: Color = (0.0, 1.0, 0.0, 1.0)
BLUE: Color = (0.0, 0.0, 1.0, 1.0)
# mani_skill 3.0.1, utils/building/actors/common.py and the tasks that use them
WHITE: Color = (1.0, 1.0, 1.0, 1.0)
TARGET_RED: Color = (194 / 255, 19 / 255, 22 / 255, 1.0)
DARK_BLUE: Color = (12 / 255, 42 / 255, 160 / 255, 1.0)
DARK_RED: Color = (176 / 255, 14 / 255, 14 / 255, 1.0)

WOOD: Color = (0.55, 0.42, 0.32, 1.0)
STONE: Color = (0.35, 0.37, 0.4, 1.0)

TABLE_MARGIN = 0.3  # of a wide table beyond the outermost bases (m)
TABLE_THICKNESS, TABLE_HEIGHT = 0.05, 0.9  # of a wide table (m)
# A quarter turn about x, then half of one about z; the cosine of that is 6e-17 in native, too.
COUNTER_TURN = (
    cos(pi / 4) * cos(pi / 2),
    sin(pi / 4) * cos(pi / 2),
    sin(pi / 4) * sin(pi / 2),
    cos(pi / 4) * sin(pi / 2),
)
UPWARD = (cos(pi / 4), 0.0, -sin(pi / 4), 0.0)  # wxyz; turns a plane's normal from x to z

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
    """Add a green ball that marks a place, touches nothing and is hidden from observing cameras.

    Args:
        world: The world.
        radius: Its radius (m).
        name: Its name.
    """
    ball = Sphere(radius=radius, color=GREEN, collides=False)
    world.add(name, ball, kind="kinematic", marker=True)


def peg_shapes(
    half_length: float, half_width: float, *, tail: Color, head: Color
) -> tuple[Shape, ...]:
    """Return what a square peg is made of, along its own x axis.

    Args:
        half_length: Half its length (m).
        half_width: Half its width and height (m).
        tail: Colour of the half at negative x.
        head: Colour of the half at positive x.
    """
    solid = Box(half_size=(half_length, half_width, half_width), visible=False)
    halves = [
        Box(
            half_size=(half_length / 2, half_width, half_width),
            position=(side * half_length / 2, 0.0, 0.0),
            color=color,
            collides=False,
        )
        for side, color in ((-1, tail), (1, head))
    ]
    return (solid, *halves)


def add_object(
    world: World,
    name: str,
    thing: ObjectDescriptor | str,
    position: Vector3 = (0.0, 0.0, 0.0),
    quaternion: Quaternion | None = None,
    *,
    seed: int | None = None,
    kind: BodyKind = "dynamic",
) -> ObjectDescriptor:
    """Add a thing of `objects.ObjectRegistry` that lies as it rests, and return what it is.

    Args:
        world: The world.
        name: Its name there.
        thing: Its name in the registry, or a descriptor.
        position: Where what it lies on is (m): its lowest point is as high.
        quaternion: How it is turned, wxyz; None as it rests.
        seed: Draws a member of its family; None takes the usual one.
        kind: ``"dynamic"`` moves by physics, ``"kinematic"`` by the task, ``"static"`` never.

    Raises:
        UnknownNameError: If there is no such thing.
        DescriptorError: If a seed is given, and it has no family.
    """
    found = ObjectRegistry.load(thing, seed) if isinstance(thing, str) else thing
    turned = found.rest() if quaternion is None else quaternion
    x, y, z = position
    place, joints = (x, y, z - lowest(found.all_parts, turned)), found.joints
    world.add(name, *found.parts, kind=kind, position=place, quaternion=turned, joints=joints)
    return found


def add_target(world: World, radius: float, name: str = "goal_region") -> None:
    """Add a disc of red and white rings that marks a place and touches nothing.

    Its axis is its own x axis; `FACE_UP` lays it down.

    Args:
        world: The world.
        radius: Its radius (m).
        name: Its name.
    """
    world.add(name, *target_shapes(radius), kind="kinematic")


def target_shapes(radius: float) -> tuple[Shape, ...]:
    """Return the rings of a target; see `add_target`."""
    return tuple(
        Cylinder(
            radius=radius * (5 - i) / 5,
            half_length=(0.5 + i) * 1e-5,  # the inner ones stand out, so that they are seen
            color=WHITE if i % 2 else TARGET_RED,
            collides=False,
        )
        for i in range(5)
    )


def wide_table_outline(
    layout: Layout, others: Sequence[tuple[float, float]] = ()
) -> tuple[float, float, float, float]:
    """Return the outline of that table's top: x_min, y_min, x_max, y_max (m).

    Args:
        layout: The robots on it.
        others: Places that it lies under like under bases, x and y (m).
    """
    bases = np.array([*(placement.base_position[:2] for placement in layout.values()), *others])
    (x_min, y_min), (x_max, y_max) = bases.min(0) - TABLE_MARGIN, bases.max(0) + TABLE_MARGIN
    return before_robots((float(x_min), float(y_min), float(x_max), float(y_max)), layout)


def before_robots(outline: Rectangle, layout: Layout) -> Rectangle:
    """Return the outline of a table that ends before robots of high shoulders that stand lower."""
    if not [at for at in layout.values() if at.position and at.position[2] < 0]:
        return outline
    from layouts.ready import before_robots as cut

    return cut(outline, layout)


def add_kitchen_counter(world: World, scale: float = 1.0) -> None:
    """Add ManiSkill's kitchen counter (a static body called ``kitchen-counter``) and the ground.

    Args:
        world: The world.
        scale: How much larger it is than its file.

    Raises:
        AssetError: If its file cannot be found.
    """
    # mani_skill 3.0.1, utils/scene_builder/kitchen_counter/scene_builder.py
    counter = Mesh(
        file=KITCHEN_COUNTER,
        scale=(scale, scale, scale),
        quaternion=COUNTER_TURN,
        collision="surface",
        textured=True,
    )
    world.add("kitchen-counter", counter, kind="static")
    add_ground(world)


def add_wide_table(world: World, others: Sequence[tuple[float, float]] = ()) -> None:
    """Add a table under all robots of a layout, its top at z = 0, and the floor below it.

    It ends `TABLE_MARGIN` beyond the outermost bases, and before robots of high shoulders that
    stand lower.

    Args:
        world: The world; its layout says where the bases are.
        others: Places that it lies under like under bases, x and y (m).
    """
    add_slab(world, wide_table_outline(world.layout, others))


def add_slab(world: World, outline: Rectangle) -> None:
    """Add a table of an outline, its top at z = 0, and the floor below it."""
    x_min, y_min, x_max, y_max = outline
    x, half_x = (x_min + x_max) / 2, (x_max - x_min) / 2
    y, half_y = (y_min + y_max) / 2, (y_max - y_min) / 2
    slab = Box(half_size=(half_x, half_y, TABLE_THICKNESS / 2), color=WOOD)
    middle = (x, y, -TABLE_THICKNESS / 2)
    world.add("table", slab, kind="kinematic", position=middle, anchored=True)
    floor = Plane(position=(0.0, 0.0, -TABLE_HEIGHT), quaternion=UPWARD, color=STONE)
    world.add("ground", floor, kind="static")
