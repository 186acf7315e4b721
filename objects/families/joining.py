"""What is put together: pegs and sockets, shafts and gears, bolts and nuts, plugs, brackets."""

from __future__ import annotations

from math import cos, pi, sin

from objects.descriptor import Grasp
from objects.families.making import (
    DOWN,
    FLAT,
    GREY_PLASTIC,
    ON_SIDE,
    PLASTIC,
    RED_PLASTIC,
    SECTIONS,
    STEEL,
    UP,
    WOOD,
    around,
    block,
    disc,
    edge,
    from_above,
    grips,
    point,
    polygon,
    prism,
    tube,
    yaw,
)
from objects.family import Made, Size, family
from objects.shapes import Shape
from robots.descriptor import IDENTITY

TEETH = 12
GAP = 0.0015  # m; around what goes into a hole

PEG = {"side": Size(0.024, 0.018, 0.03), "length": Size(0.11, 0.09, 0.14)}
SHAFT = {"radius": Size(0.008, 0.006, 0.01), "length": Size(0.07, 0.06, 0.09)}
BOLT = {"radius": Size(0.008, 0.006, 0.01), "length": Size(0.05, 0.04, 0.06)}
PLUG = {"apart": Size(0.02, 0.016, 0.024), "pin": Size(0.006, 0.005, 0.007)}


@family(PEG)
def peg(side: float, length: float) -> Made:
    """A square peg that stands on its end."""
    ends = [
        grasp
        for out in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
        for grasp in grips(
            (0.0, 0.0, 0.5 * length), UP, out, side, "side", offsets=(-0.015, 0.0, 0.015)
        )
    ]
    above = [
        grasp
        for along in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        for grasp in grips((0.0, 0.0, length - 0.015), along, UP, side, "end")
    ]
    return Made(
        [block((side, side, length), (0.0, 0.0, length / 2), WOOD)],
        [*ends, *above],
        {"tip": point(0.0, 0.0, 0.0, DOWN), "end": point(0.0, 0.0, length)},
        {"upright": IDENTITY, "lying": ON_SIDE},
    )


@family(PEG, fits="peg")
def socket(side: float, length: float) -> Made:
    """The socket of a square peg: a block with a square hole."""
    hole, deep = side / 2 + GAP, 0.4 * length
    outer, base = hole + 0.012, 0.01
    return Made(
        [
            block((2 * outer, 2 * outer, base), (0.0, 0.0, base / 2), GREY_PLASTIC),
            *_frame(hole, outer, base, base + deep),
        ],
        [
            grasp
            for turn in around(4)
            for grasp in grips(
                (
                    (hole + 0.006) * cos(turn),
                    (hole + 0.006) * sin(turn),
                    base + deep - 0.01,
                ),
                (-sin(turn), cos(turn), 0.0),
                UP,
                0.012,
                "wall",
                offsets=(-0.004, 0.0, 0.004),
            )
        ],
        {"hole": point(0.0, 0.0, base + deep), "bottom": point(0.0, 0.0, base)},
    )


def _frame(inner: float, outer: float, bottom: float, top: float) -> list[Shape]:
    """Return four walls around a square hole, each as long as it may be without overlaps."""
    height, middle, wall = top - bottom, (bottom + top) / 2, outer - inner
    at = (inner + outer) / 2
    return [
        *(block((2 * outer, wall, height), (0.0, y, middle), GREY_PLASTIC) for y in (-at, at)),
        *(block((wall, 2 * inner, height), (x, 0.0, middle), GREY_PLASTIC) for x in (-at, at)),
    ]


@family(SHAFT)
def shaft(radius: float, length: float) -> Made:
    """An upright shaft on a base, for a gear."""
    base, half = 0.012, 0.03
    return Made(
        [
            block((2 * half, 2 * half, base), (0.0, 0.0, base / 2), GREY_PLASTIC),
            disc(radius, base, base + length, STEEL),
        ],
        [
            *_rod_grips(radius, base, length, "shaft"),
            *_foot_grips(base / 2, 2 * half, "base", 4),
        ],
        {"tip": point(0.0, 0.0, base + length), "seat": point(0.0, 0.0, base)},
    )


@family(SHAFT, fits="shaft")
def gear(radius: float, length: float) -> Made:
    """A gear that goes over a shaft."""
    thick, hub, root = 0.014, radius + 0.012, 0.034
    tooth = 2 * pi * root / TEETH * 0.45
    teeth = [
        block(
            (0.009, tooth, thick),
            (
                (root + 0.0035) * cos(angle),
                (root + 0.0035) * sin(angle),
                thick / 2,
            ),
            RED_PLASTIC,
            yaw(angle),
        )
        for angle in around(TEETH)
    ]
    outer = tube((hub, root, 0.0), (hub, root, thick), RED_PLASTIC, 2 * TEETH)
    hole = radius + GAP
    inner = tube((hole, hub, 0.0), (hole, hub, thick + 0.012), RED_PLASTIC)
    return Made(
        [*outer, *inner, *teeth],
        [
            *from_above(
                thick + 0.006,
                2 * hub * FLAT,
                "hub",
                around(8, pi / SECTIONS, pi + pi / SECTIONS),
                pitches=(-0.15, 0.15),
            ),
            *edge(root, thick / 2, thick, "teeth"),
        ],
        {"bore": point(0.0, 0.0, 0.0, DOWN), "hub": point(0.0, 0.0, thick + 0.012)},
    )


@family(BOLT)
def bolt(radius: float, length: float) -> Made:
    """A bolt that stands on its hexagonal head; its thread is smooth."""
    head, thick = 1.9 * radius, 1.4 * radius
    return Made(
        [
            prism(polygon(head, 6), 0.0, thick, STEEL),
            disc(radius, thick, thick + length, STEEL),
        ],
        [
            *_rod_grips(radius, thick, length, "shank"),
            *_foot_grips(thick / 2, 2 * head * cos(pi / 6), "head", 6),
        ],
        {"tip": point(0.0, 0.0, thick + length), "head": point(0.0, 0.0, 0.0, DOWN)},
    )


@family(BOLT, fits="bolt")
def nut(radius: float, length: float) -> Made:
    """A hexagonal nut that goes over a bolt."""
    thick, outer, hole = 1.8 * radius, 2.2 * radius, radius + 0.0006
    flat = outer * cos(pi / 6)
    return Made(
        tube((hole, outer, 0.0), (hole, outer, thick), STEEL, 6),
        from_above(
            0.55 * thick,
            2 * flat,
            "flats",
            around(3, 2 * pi / 3, 5 * pi / 3),
            pitches=(-0.3, -0.1, 0.1, 0.3),
        ),
        {"bore": point(0.0, 0.0, 0.0, DOWN), "top": point(0.0, 0.0, thick)},
    )


@family(PLUG)
def plug(apart: float, pin: float) -> Made:
    """A plug with two pins; it lies, and its pins point along x."""
    body, high, wide = 0.05, 0.024, apart + 0.02
    pins = [
        block((0.022, pin, pin), (body / 2 + 0.011, side * apart / 2, high / 2), STEEL)
        for side in (-1, 1)
    ]
    return Made(
        [block((body, wide, high), (0.0, 0.0, high / 2), PLASTIC), *pins],
        [
            *grips(
                (-0.005, 0.0, high / 2),
                (1.0, 0.0, 0.0),
                UP,
                wide,
                "body",
                offsets=(-0.012, -0.004, 0.004),
                pitches=(-0.3, 0.0, 0.3),
            ),
            *grips(
                (-0.012, 0.0, high / 2),
                (0.0, 1.0, 0.0),
                (-1.0, 0.0, 0.0),
                high,
                "body",
                offsets=(-0.006, 0.0, 0.006),
            ),
        ],
        {"tip": point(body / 2 + 0.022, 0.0, high / 2, (1.0, 0.0, 0.0))},
    )


@family(PLUG, fits="plug")
def outlet(apart: float, pin: float) -> Made:
    """The outlet of a plug: a standing block with two square holes, open along x."""
    hole, high, deep = pin + 2 * GAP, 0.05, 0.03
    wide, middle = apart + 0.05, 0.012  # the holes are as high as a plug's pins
    outer = (wide - apart - hole) / 2
    low, up = middle - hole / 2, high - middle - hole / 2
    back = 0.01
    return Made(
        [
            block((deep, wide, low), (0.0, 0.0, low / 2), GREY_PLASTIC),
            block((deep, wide, up), (0.0, 0.0, high - up / 2), GREY_PLASTIC),
            block((deep, apart - hole, hole), (0.0, 0.0, middle), GREY_PLASTIC),
            *(
                block((deep, outer, hole), (0.0, side * (wide - outer) / 2, middle), GREY_PLASTIC)
                for side in (-1, 1)
            ),
            block((back, wide, high), (-(deep + back) / 2, 0.0, high / 2), GREY_PLASTIC),
        ],
        grips(
            (-back / 2, 0.0, high - 0.014),
            (0.0, 1.0, 0.0),
            UP,
            deep + back,
            "body",
            offsets=(-0.015, 0.0, 0.015),
            pitches=(-0.4, -0.2, 0.0, 0.2),
        ),
        {"holes": point(deep / 2, 0.0, middle, (1.0, 0.0, 0.0))},
    )


@family({"length": Size(0.07, 0.06, 0.09), "width": Size(0.04, 0.03, 0.05)})
def bracket(length: float, width: float) -> Made:
    """An L-shaped bracket with a hole in each leg."""
    thick, hole = 0.005, 0.004
    legs = [
        leg for flat in (True, False) for leg in _drilled(length, width, thick, hole, flat=flat)
    ]
    return Made(
        legs,
        [
            *grips(
                (thick / 2, 0.0, length - 0.01),
                (0.0, 1.0, 0.0),
                UP,
                thick,
                "upright leg",
                offsets=(-0.005, 0.0, 0.005),
                pitches=(-0.3, 0.0, 0.3),
            ),
            *grips(
                (length - 0.01, 0.0, thick / 2),
                (0.0, 1.0, 0.0),
                (1.0, 0.0, 0.0),
                thick,
                "flat leg",
                offsets=(-0.005, 0.005),
            ),
        ],
        {
            "corner": point(thick, 0.0, thick, (0.7071067811865476, 0.0, 0.7071067811865476)),
            "hole": point(0.65 * length, 0.0, thick),
        },
    )


def _drilled(length: float, width: float, thick: float, hole: float, *, flat: bool) -> list[Shape]:
    """Return a leg with a square hole, of four blocks; the upright one ends on the flat one."""
    start = 0.0 if flat else thick
    at = 0.65 * length
    spans = [(start, at - hole, 0.0, width), (at + hole, length, 0.0, width)]
    side = (width - 2 * hole) / 2
    spans += [(at - hole, at + hole, sign * (width - side) / 2, side) for sign in (-1, 1)]
    found: list[Shape] = []
    for low, high, y, wide in spans:
        size, middle = (high - low, wide, thick), ((low + high) / 2, y, thick / 2)
        if not flat:
            size, middle = (thick, wide, high - low), (thick / 2, y, (low + high) / 2)
        found.append(block(size, middle, STEEL))
    return found


def _rod_grips(radius: float, low: float, length: float, part: str) -> list[Grasp]:
    """Return grasps of an upright rod that begins at a height: all round, and of its tip."""
    middle, top = (0.0, 0.0, low + 0.6 * length), low + length - 0.012
    return [
        *grips(middle, UP, (1.0, 0.0, 0.0), 2 * radius, part, tilts=around(8)),
        *from_above(top, 2 * radius, "tip", around(4, 0.0, pi)),
    ]


def _foot_grips(height: float, width: float, part: str, sides: int) -> list[Grasp]:
    """Return grasps of an upright thing's foot, by its faces: from all sides, and from below.

    Args:
        height: Of the fingers' middle.
        width: Of the foot, from face to face.
        part: What it is called.
        sides: How many faces it has, the first along y.
    """
    middle = (0.0, 0.0, height)
    return [
        *grips(middle, UP, (1.0, 0.0, 0.0), width, part, tilts=around(sides)),
        *(
            grasp
            for angle in around(sides // 2, 0.0, pi)
            for grasp in grips(middle, (cos(angle), sin(angle), 0.0), DOWN, width, part)
        ),
    ]
