"""What opens: drawers, doors, lids, windows. Their fronts look along the x axis."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from objects.families.making import (
    CARDBOARD,
    DARK_WOOD,
    GREY_PLASTIC,
    LIGHT_WOOD,
    MELAMINE,
    PLASTIC,
    STEEL,
    UP,
    WOOD,
    Axis,
    Matter,
    around,
    block,
    disc,
    from_above,
    grips,
    loop,
    point,
    rod,
    taper,
    tube,
    walls,
)
from objects.family import Made, Size, family
from objects.joints import Joint
from objects.shapes import Shape

FRONT: Axis = (1.0, 0.0, 0.0)
SIDE: Axis = (0.0, 1.0, 0.0)
GAP = 0.002  # m; between what moves and what holds it
WALL = 0.008
BAR, STANDOFF = 0.012, 0.045  # of handles: their thickness, and how far from the surface
DOWNWARD = (-0.45, -0.3, -0.15, 0.0)  # rad
TILTS = (-0.3, -0.15, 0.0, 0.15, 0.3)  # rad
LEAN = (-0.6, -0.3, 0.0, 0.3, 0.6)  # rad
ALONG = (-0.02, 0.0, 0.02)  # m along a handle

BOX = {
    "length": Size(0.24, 0.2, 0.28),
    "width": Size(0.26, 0.22, 0.32),
    "height": Size(0.14, 0.12, 0.18),
}


def handle(middle: Axis, along: Axis, out: Axis, length: float, part: str) -> Made:
    """Return a handle on a surface: a round bar that two arms hold, and the grasps of it."""
    _, *arms = loop(middle, along, out, STANDOFF, length, BAR, STEEL)
    x, y, z = (a + STANDOFF * b for a, b in zip(middle, out, strict=True))
    ends = [np.add((x, y, z), np.multiply(along, side * length / 2)) for side in (-1, 1)]
    held = rod(ends[0], ends[1], BAR / 2, STEEL)
    return Made([held, *arms], grips((x, y, z), along, out, BAR, part, offsets=ALONG, tilts=LEAN))


def case(length: float, width: float, bottom: float, top: float, made_of: Matter) -> list[Shape]:
    """Return a box that is open in front."""
    tall, middle = top - bottom, (bottom + top) / 2
    inner = length - WALL
    return [
        block((length, width, WALL), (0.0, 0.0, bottom + WALL / 2), made_of),
        block((length, width, WALL), (0.0, 0.0, top - WALL / 2), made_of),
        block((WALL, width, tall - 2 * WALL), ((WALL - length) / 2, 0.0, middle), made_of),
        *(
            block((inner, WALL, tall - 2 * WALL), (WALL / 2, side, middle), made_of)
            for side in (-(width - WALL) / 2, (width - WALL) / 2)
        ),
    ]


def sliding_drawer(
    name: str, length: float, width: float, bottom: float, top: float, travel: float
) -> tuple[Joint, Made]:
    """Return a drawer of a case, and its handle."""
    wide, long = width - 2 * (WALL + GAP), length - WALL - GAP
    low, high = bottom + WALL + GAP, top - WALL - GAP
    x = (WALL + GAP) / 2
    pull = handle((length / 2, 0.0, (low + high) / 2), SIDE, FRONT, 0.11, name)
    shapes = [
        block((long, wide, 0.006), (x, 0.0, low + 0.003), LIGHT_WOOD),
        *(shape_at(wall, x) for wall in walls(long, wide, low + 0.006, high, 0.006, LIGHT_WOOD)),
        *pull.parts,
    ]
    joint = Joint(
        name=name,
        kind="slide",
        parts=tuple(shapes),
        axis=FRONT,
        upper=round(travel, 4),
        damping=5.0,
    )
    return joint, pull


def shape_at(shape: Shape, x: float) -> Shape:
    """Return a shape that is moved along x."""
    a, b, c = shape.position
    return replace(shape, position=(round(a + x, 9), b, c))


@family(BOX)
def drawer(length: float, width: float, height: float) -> Made:
    """A case with one drawer."""
    joint, pull = sliding_drawer("drawer", length, width, 0.0, height, 0.7 * length)
    return Made(
        case(length, width, 0.0, height, WOOD),
        pull.grasps,
        {"handle": point(length / 2 + STANDOFF, 0.0, height / 2, FRONT)},
        joints=[joint],
    )


@family({**BOX, "height": Size(0.24, 0.22, 0.3)})
def chest(length: float, width: float, height: float) -> Made:
    """A chest of two drawers."""
    half = height / 2
    low, low_pull = sliding_drawer("lower", length, width, 0.0, half, 0.7 * length)
    high, high_pull = sliding_drawer("upper", length, width, half, height, 0.7 * length)
    return Made(
        case(length, width, 0.0, half, WOOD) + case(length, width, half, height, WOOD),
        [*low_pull.grasps, *high_pull.grasps],
        {"top": point(0.0, 0.0, height)},
        joints=[low, high],
    )


@family({**BOX, "height": Size(0.26, 0.22, 0.3)})
def cupboard(length: float, width: float, height: float) -> Made:
    """A cupboard with one door, which hangs on its left."""
    thick, edge = 0.014, length / 2 + GAP
    inner = 0.5 * width - 0.03
    pull = handle((edge + thick, inner, height / 2), UP, FRONT, 0.1, "door")
    door = block((thick, width - GAP, height), (edge + thick / 2, 0.0, height / 2), WOOD)
    hinge = Joint(
        name="door",
        kind="turn",
        parts=(door, *pull.parts),
        axis=(0.0, 0.0, -1.0),
        at=(edge, -width / 2, 0.0),
        upper=1.9,
        damping=0.2,
    )
    return Made(
        case(length, width, 0.0, height, LIGHT_WOOD),
        pull.grasps,
        {"inside": point(0.0, 0.0, WALL)},
        joints=[hinge],
    )


@family({**BOX, "width": Size(0.2, 0.16, 0.24), "height": Size(0.1, 0.08, 0.12)})
def hinged_box(length: float, width: float, height: float) -> Made:
    """A box whose lid turns up at its back."""
    thick, back = 0.006, -length / 2
    lip = grips(
        (length / 2 + 0.012, 0.0, height + GAP + thick / 2),
        SIDE,
        FRONT,
        thick,
        "lid",
        offsets=(-0.03, -0.01, 0.01, 0.03),
        tilts=LEAN,
    )
    lid = block((length + 0.02, width, thick), (0.01, 0.0, height + GAP + thick / 2), DARK_WOOD)
    return Made(
        [
            block((length, width, WALL), (0.0, 0.0, WALL / 2), WOOD),
            *walls(length, width, WALL, height, WALL, WOOD),
        ],
        lip,
        {"inside": point(0.0, 0.0, WALL), "lip": point(length / 2 + 0.02, 0.0, height, FRONT)},
        joints=[
            Joint(
                name="lid",
                kind="turn",
                parts=(lid,),
                axis=(0.0, -1.0, 0.0),
                at=(back, 0.0, height + GAP),
                upper=1.9,
                damping=0.05,
            )
        ],
    )


@family({"length": Size(0.22, 0.2, 0.25), "width": Size(0.3, 0.27, 0.34)})
def laptop(length: float, width: float) -> Made:
    """A laptop, closed, with its screen hinged at the back."""
    base, thick, lip = 0.016, 0.008, 0.016
    z = base + GAP + thick / 2
    screen = block((length + lip, width, thick), (lip / 2, 0.0, z), GREY_PLASTIC)
    return Made(
        [block((length, width, base), (0.0, 0.0, base / 2), GREY_PLASTIC)],
        grips(
            (length / 2 + lip - 0.005, 0.0, z),
            SIDE,
            FRONT,
            thick,
            "screen",
            offsets=ALONG,
            tilts=DOWNWARD,
        ),
        {"lip": point(length / 2 + lip, 0.0, z, FRONT)},
        joints=[
            Joint(
                name="screen",
                kind="turn",
                parts=(screen,),
                axis=(0.0, -1.0, 0.0),
                at=(-length / 2, 0.0, base + GAP),
                upper=2.2,
                friction=0.05,
                damping=0.2,
            )
        ],
    )


@family({"width": Size(0.4, 0.34, 0.46), "height": Size(0.26, 0.22, 0.3)})
def window(width: float, height: float) -> Made:
    """A window with a pane that slides to its left."""
    thick, deep = 0.024, 0.06
    bars = [
        block((deep, width, thick), (0.0, 0.0, z), MELAMINE)
        for z in (thick / 2, height - thick / 2)
    ] + [
        block((deep, thick, height - 2 * thick), (0.0, side, height / 2), MELAMINE)
        for side in (-(width - thick) / 2, (width - thick) / 2)
    ]
    wide, tall = width / 2 - thick, height - 2 * (thick + GAP)
    y = width / 4 - thick / 2 - GAP
    pull = handle((0.021, y, height / 2), UP, FRONT, 0.1, "pane")
    glass = block((0.01, wide, tall), (0.016, y, height / 2), PLASTIC)
    pane = Joint(
        name="pane",
        kind="slide",
        parts=(glass, *pull.parts),
        axis=(0.0, -1.0, 0.0),
        upper=round(2 * y, 4),
        damping=5.0,
    )
    return Made(bars, pull.grasps, {"sill": point(0.0, 0.0, thick)}, joints=[pane])


@family({"length": Size(0.24, 0.2, 0.28), "height": Size(0.24, 0.2, 0.28)})
def swing_bin(length: float, height: float) -> Made:
    """A bin whose flap hangs from above and swings shut by a spring."""
    wall, thick, drop = 0.006, 0.006, 0.1
    top = height + drop
    flap = block(
        (thick, length - 0.04, drop - 0.01), (length / 2 - 0.02, 0.0, top - drop / 2), PLASTIC
    )
    knob = block((0.03, 0.06, 0.012), (length / 2 - 0.02 + 0.018, 0.0, top - 0.08), GREY_PLASTIC)
    posts = [
        block((0.03, 0.012, drop), (length / 2 - 0.02, side, height + drop / 2), GREY_PLASTIC)
        for side in (-length / 2 + 0.01, length / 2 - 0.01)
    ]
    return Made(
        [
            block((length, length, wall), (0.0, 0.0, wall / 2), GREY_PLASTIC),
            *walls(length, length, wall, height, wall, GREY_PLASTIC),
            *posts,
        ],
        grips(
            (length / 2 + 0.006, 0.0, top - 0.08),
            SIDE,
            FRONT,
            0.012,
            "flap",
            offsets=ALONG,
            tilts=TILTS,
        ),
        {"inside": point(0.0, 0.0, wall)},
        joints=[
            Joint(
                name="flap",
                kind="turn",
                parts=(flap, knob),
                axis=(0.0, -1.0, 0.0),
                at=(length / 2 - 0.02, 0.0, top),
                lower=-1.2,
                upper=1.2,
                damping=0.02,
                stiffness=0.15,
            )
        ],
    )


@family({"radius": Size(0.04, 0.034, 0.048), "height": Size(0.1, 0.08, 0.12)})
def screw_jar(radius: float, height: float) -> Made:
    """A jar whose lid turns, three times round from shut to loose."""
    lid, cap = 0.85 * radius, 0.02
    return Made(
        [
            disc(radius, 0.0, 0.008, CARDBOARD),
            *tube((radius - 0.006, radius, 0.008), (radius - 0.006, radius, height), CARDBOARD),
        ],
        from_above(height + GAP + cap / 2, 2 * lid, "lid", around(8, 0.0, pi), (-0.2, 0.0, 0.2)),
        {"top": point(0.0, 0.0, height + GAP + cap)},
        joints=[
            Joint(
                name="lid",
                kind="turn",
                parts=(taper(lid, height + GAP, lid, height + GAP + cap, STEEL),),
                axis=UP,
                upper=round(6 * pi, 4),
                damping=0.01,
            )
        ],
    )
