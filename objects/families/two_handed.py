"""What takes two hands: one holds, or keeps a spring back, while the other works."""

from __future__ import annotations

from math import cos, pi, sin

from objects.descriptor import Grasp
from objects.families.furniture import FRONT, LEAN, SIDE, TILTS, case, handle
from objects.families.making import (
    DARK_WOOD,
    GREY_PLASTIC,
    LIGHT_WOOD,
    PLASTIC,
    RED_PLASTIC,
    STEEL,
    UP,
    WOOD,
    around,
    block,
    disc,
    from_above,
    grips,
    loop,
    point,
    polygon,
    prism,
    rod,
    tube,
    walls,
)
from objects.family import Made, Size, family
from objects.joints import Joint

GAP = 0.002  # m; between what moves and what holds it
OPEN = 1.9  # rad
FACES = around(4, pi / 8, 9 * pi / 8)  # rad; of an octagon
PITCHES = (-0.3, 0.0, 0.3)  # rad


@family({"length": Size(0.12, 0.1, 0.14), "height": Size(0.06, 0.05, 0.08)})
def interlock(length: float, height: float) -> Made:
    """A lever that turns only while a bolt is pulled out of its way, against a spring."""
    z, knob = height + 0.01, height + length
    x = 0.02 + GAP  # where the bolt begins, in front of the lever
    cheeks = [
        block((0.05, 0.01, height - 0.012), (0.0, side, height / 2 + 0.006), GREY_PLASTIC)
        for side in (-0.022, 0.022)
    ]
    guides = [
        block((0.04, 0.008, z + 0.012), (0.09, side, z / 2 + 0.006), GREY_PLASTIC)
        for side in (-0.02, 0.02)
    ]
    shaft = block((0.11, 0.02, 0.016), (x + 0.055, 0.0, z + 0.012), STEEL)
    pulled = block((0.016, 0.02, 0.05), (x + 0.102, 0.0, z + 0.045), RED_PLASTIC)
    bed = block((0.04, 0.03, z), (0.09, 0.0, z / 2), GREY_PLASTIC)
    return Made(
        [block((0.3, 0.1, 0.012), (0.05, 0.0, 0.006), GREY_PLASTIC), *cheeks, *guides, bed],
        grips((0.0, 0.0, knob - 0.02), SIDE, UP, 0.024, "lever", tilts=TILTS, pitches=PITCHES)
        + grips((x + 0.102, 0.0, z + 0.055), SIDE, UP, 0.016, "bolt", tilts=TILTS),
        {"knob": point(0.0, 0.0, knob + 0.01), "bolt": point(x + 0.11, 0.0, z + 0.05, FRONT)},
        joints=[
            Joint(
                name="lever",
                kind="turn",
                parts=(
                    block((0.03, 0.024, 0.06), (0.0, 0.0, height + 0.022), STEEL),
                    rod((0.0, 0.0, height + 0.05), (0.0, 0.0, knob - 0.05), 0.008, STEEL),
                    block((0.024, 0.024, 0.06), (0.0, 0.0, knob - 0.02), RED_PLASTIC),
                ),
                axis=SIDE,
                at=(0.0, 0.0, height - 0.008),
                lower=-0.3,
                upper=1.0,
                start=-0.3,
                damping=0.05,
            ),
            Joint(
                name="bolt",
                kind="slide",
                parts=(shaft, pulled),
                axis=FRONT,
                upper=0.06,
                damping=2.0,
                stiffness=60.0,
                rest=-0.02,
            ),
        ],
    )


@family({"radius": Size(0.027, 0.023, 0.032), "height": Size(0.13, 0.11, 0.16)})
def pepper_mill(radius: float, height: float) -> Made:
    """A pepper mill: one hand holds it, the other turns its head."""
    width, low, high = 2 * radius * cos(pi / 8), height + GAP, height + GAP + 0.035
    held = [
        grasp
        for a in FACES
        for grasp in grips(
            (0.0, 0.0, height / 2),
            UP,
            (cos(a), sin(a), 0.0),
            width,
            "body",
            offsets=(-0.015, 0.0, 0.015),
        )
    ]
    return Made(
        [prism(polygon(radius, 8), 0.0, height, DARK_WOOD)],
        held + from_above((low + high) / 2 + 0.003, width, "head", FACES, PITCHES),
        {"top": point(0.0, 0.0, high)},
        joints=[
            Joint(
                name="head",
                kind="turn",
                parts=(prism(polygon(radius, 8), low, high, WOOD),),
                axis=UP,
                lower=-100.0,
                upper=100.0,
                damping=0.01,
            )
        ],
    )


@family({"radius": Size(0.045, 0.04, 0.05), "height": Size(0.16, 0.14, 0.18)})
def coffee_press(radius: float, height: float) -> Made:
    """A jug with a plunger that is pressed down while the other hand holds the handle."""
    wall, top, low = 0.0025, height + 0.05, height - 0.03
    inner, knob, bar = radius * 0.98 - wall, 0.014, 0.012
    out = radius + 0.036  # the middle of the handle
    pull = loop((radius - 0.004, 0.0, height / 2), UP, FRONT, 0.04, 0.09, bar, PLASTIC)
    places = (-0.009, -0.003, 0.003, 0.009)
    held = grips((out, 0.0, height / 2), UP, FRONT, bar, "body", offsets=places, pitches=PITCHES)
    return Made(
        [
            disc(radius, 0.0, 0.006, PLASTIC),
            *tube((inner, radius, 0.006), (inner, radius, height), PLASTIC),
            *pull,
        ],
        held,
        {"knob": point(0.0, 0.0, top + 0.024), "inside": point(0.0, 0.0, 0.006)},
        joints=[
            Joint(
                name="plunger",
                kind="slide",
                parts=(
                    disc(inner - GAP, low, low + 0.006, GREY_PLASTIC),
                    disc(0.004, low + 0.006, top, STEEL),
                    prism(polygon(knob, 8), top, top + 0.024, PLASTIC),
                ),
                axis=(0.0, 0.0, -1.0),
                upper=round(height - 0.06, 4),
                damping=10.0,
                stiffness=60.0,
                rest=-0.05,
            )
        ],
    )


@family(
    {
        "length": Size(0.2, 0.17, 0.24),
        "width": Size(0.3, 0.26, 0.36),
        "height": Size(0.09, 0.07, 0.11),
    }
)
def suitcase(length: float, width: float, height: float) -> Made:
    """A case whose lid opens once both its latches are pulled forward."""
    thick, front, away = 0.006, length / 2, width / 2 - 0.04
    level = height + GAP + thick / 2
    tongue = height + 2 * GAP + thick + 0.003
    lip = grips(
        (front + 0.012, 0.0, level),
        SIDE,
        FRONT,
        thick,
        "lid",
        offsets=(-0.02, 0.0, 0.02),
        tilts=LEAN,
    )
    latches, held = list[Joint](), lip
    for name, y in (("left", away), ("right", -away)):
        tab = (front + 0.035, y, tongue + 0.028)
        parts = (
            block((0.054, 0.02, 0.006), (front + 0.013, y, tongue), STEEL),
            block((0.01, 0.02, 0.05), (front + 0.035, y, tongue - 0.028), STEEL),
            block((0.01, 0.02, 0.05), tab, RED_PLASTIC),
        )
        latches.append(
            Joint(name=name, kind="slide", parts=parts, axis=FRONT, upper=0.045, damping=3.0)
        )
        held += grips((tab[0], y, tab[2] + 0.008), SIDE, UP, 0.01, name, tilts=TILTS)
    guides = [
        block((0.02, 0.03, 0.02), (front + 0.01, y, height - 0.03), GREY_PLASTIC)
        for y in (-away, away)
    ]
    lid = block((length + 0.02, width, thick), (0.01, 0.0, level), DARK_WOOD)
    return Made(
        [
            block((length, width, 0.008), (0.0, 0.0, 0.004), WOOD),
            *walls(length, width, 0.008, height, 0.008, WOOD),
            *guides,
        ],
        held,
        {"inside": point(0.0, 0.0, 0.008), "lip": point(front + 0.02, 0.0, height, FRONT)},
        joints=[
            Joint(
                name="lid",
                kind="turn",
                parts=(lid,),
                axis=(0.0, -1.0, 0.0),
                at=(-front, 0.0, height + GAP),
                upper=OPEN,
                damping=0.05,
            ),
            *latches,
        ],
    )


@family({"width": Size(0.22, 0.18, 0.26), "height": Size(0.14, 0.12, 0.16)})
def drop_leaf_table(width: float, height: float) -> Made:
    """A small table whose two leaves hang down, and are lifted with a hand each."""
    half, thick, long = 0.08, 0.012, height - 0.03
    joints, held = list[Joint](), list[Grasp]()
    for name, side in (("front", 1.0), ("back", -1.0)):
        x = side * (half + GAP + thick / 2)
        leaf = block((thick, width, long), (x, 0.0, height - long / 2), LIGHT_WOOD)
        joints.append(
            Joint(
                name=name,
                kind="turn",
                parts=(leaf,),
                axis=(0.0, -side, 0.0),
                at=(side * (half + GAP), 0.0, height),
                upper=round(pi / 2, 4),
                damping=0.02,
            )
        )
        for end in (-1.0, 1.0):
            held += grips(
                (x, end * (width / 2 - 0.012), height - long + 0.03),
                UP,
                (0.0, end, 0.0),
                thick,
                name,
                offsets=(-0.01, 0.0, 0.01),
                pitches=(-0.15, 0.0, 0.15),
            )
    return Made(
        [
            block((2 * half, width, thick), (0.0, 0.0, height - thick / 2), WOOD),
            block((0.05, 0.05, height - thick - 0.012), (0.0, 0.0, height / 2), WOOD),
            block((0.12, 0.7 * width, 0.012), (0.0, 0.0, 0.006), WOOD),
        ],
        held,
        {"middle": point(0.0, 0.0, height)},
        joints=joints,
    )


@family(
    {
        "length": Size(0.2, 0.18, 0.24),
        "width": Size(0.34, 0.3, 0.4),
        "height": Size(0.26, 0.22, 0.3),
    }
)
def wardrobe(length: float, width: float, height: float) -> Made:
    """A wardrobe with two doors."""
    thick, edge = 0.014, length / 2 + GAP
    joints, held = list[Joint](), list[Grasp]()
    for name, side in (("left", 1.0), ("right", -1.0)):
        pull = handle((edge + thick, side * 0.035, height / 2), UP, FRONT, 0.1, name)
        door = block(
            (thick, width / 2 - GAP, height),
            (edge + thick / 2, side * width / 4, height / 2),
            WOOD,
        )
        joints.append(
            Joint(
                name=name,
                kind="turn",
                parts=(door, *pull.parts),
                axis=(0.0, 0.0, side),
                at=(edge, side * width / 2, 0.0),
                upper=OPEN,
                damping=0.2,
            )
        )
        held += pull.grasps
    return Made(
        case(length, width, 0.0, height, LIGHT_WOOD),
        held,
        {"inside": point(0.0, 0.0, 0.008)},
        joints=joints,
    )


@family({"width": Size(0.4, 0.34, 0.46), "radius": Size(0.024, 0.02, 0.03)})
def two_hand_control(width: float, radius: float) -> Made:
    """A control of a press: two buttons so far apart that each takes a hand."""
    height, away = 0.05, width / 2 - 0.06
    low = height + 0.012
    joints = list[Joint]()
    for name, y in (("left", away), ("right", -away)):
        cap = prism(_at(polygon(radius, 12), y), low - 0.006, low + 0.012, RED_PLASTIC)
        joints.append(
            Joint(
                name=name,
                kind="slide",
                parts=(cap,),
                axis=(0.0, 0.0, -1.0),
                upper=0.006,
                damping=2.0,
                stiffness=300.0,
                rest=-0.004,
            )
        )
    return Made(
        [block((0.12, width, height), (0.0, 0.0, height / 2), GREY_PLASTIC)],
        points={
            "left": point(0.0, away, low + 0.012),
            "right": point(0.0, -away, low + 0.012),
        },
        joints=joints,
    )


def _at(outline: list[tuple[float, float]], y: float) -> list[tuple[float, float]]:
    return [(a, b + y) for a, b in outline]
