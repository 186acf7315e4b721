"""Material and tools: beams, boards, bricks, hammers, screwdrivers, spoons."""

from __future__ import annotations

from math import cos, pi, sin

from objects.families.making import (
    CLAY,
    DARK_WOOD,
    LIGHT_WOOD,
    ON_SIDE,
    RED_PLASTIC,
    STEEL,
    UP,
    WOOD,
    around,
    block,
    grips,
    hexagon,
    point,
    prism,
    rod,
)
from objects.family import Made, Size, family
from robots.descriptor import IDENTITY

ALONG = (1.0, 0.0, 0.0)
LEAN = (-0.5, 0.0, 0.5)  # rad; tilts of a gripper at a bar


@family({"length": Size(0.5, 0.35, 0.7), "side": Size(0.03, 0.024, 0.034)})
def beam(length: float, side: float) -> Made:
    """A long square beam, for two hands."""
    return Made(
        [block((length, side, side), (0.0, 0.0, side / 2), WOOD)],
        grips(
            (0.0, 0.0, side / 2),
            ALONG,
            UP,
            side,
            "beam",
            offsets=[share * length for share in (-0.2, -0.1, 0.0, 0.1, 0.2)],
            pitches=(-0.3, 0.0, 0.3),
        ),
        {
            "left_end": point(-length / 2, 0.0, side / 2, (-1.0, 0.0, 0.0)),
            "right_end": point(length / 2, 0.0, side / 2, ALONG),
        },
    )


@family(
    {
        "length": Size(0.4, 0.3, 0.5),
        "width": Size(0.2, 0.15, 0.25),
        "thickness": Size(0.018, 0.012, 0.022),
    }
)
def board(length: float, width: float, thickness: float) -> Made:
    """A wide board, for two hands."""
    ends = [
        grasp
        for side in (-1.0, 1.0)
        for grasp in grips(
            (side * (length / 2 - 0.015), 0.0, thickness / 2),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            thickness,
            "end",
            offsets=(-0.03, -0.01, 0.01, 0.03),
            pitches=(-0.2, 0.2),
        )
    ]
    return Made(
        [block((length, width, thickness), (0.0, 0.0, thickness / 2), LIGHT_WOOD)],
        ends,
        {"middle": point(0.0, 0.0, thickness)},
        {"flat": IDENTITY},
    )


@family(
    {
        "length": Size(0.12, 0.1, 0.14),
        "width": Size(0.06, 0.05, 0.068),
        "height": Size(0.04, 0.032, 0.05),
    }
)
def brick(length: float, width: float, height: float) -> Made:
    """A small solid brick."""
    return Made(
        [block((length, width, height), (0.0, 0.0, height / 2), CLAY)],
        grips(
            (0.0, 0.0, 0.55 * height),
            ALONG,
            UP,
            width,
            "sides",
            offsets=(-0.03, -0.015, 0.0, 0.015, 0.03),
            pitches=(-0.3, 0.0, 0.3),
        ),
        {"top": point(0.0, 0.0, height)},
        {"flat": IDENTITY, "on_edge": ON_SIDE},
    )


@family({"length": Size(0.26, 0.2, 0.3), "head": Size(0.09, 0.075, 0.11)})
def hammer(length: float, head: float) -> Made:
    """A hammer that lies on its side."""
    radius, side = 0.012, 0.024
    start, end = (-length / 2, 0.0, side / 2), (length / 2 - side, 0.0, side / 2)
    return Made(
        [
            rod(start, end, radius, DARK_WOOD),
            block((side, head, side), (length / 2 - side / 2, 0.0, side / 2), STEEL),
        ],
        grips(
            (0.0, 0.0, side / 2),
            ALONG,
            UP,
            2 * radius,
            "handle",
            offsets=[share * length for share in (-0.05, 0.05, 0.15, 0.25)],
            tilts=LEAN,
        ),
        {
            "face": point(length / 2 - side / 2, head / 2, side / 2, (0.0, 1.0, 0.0)),
            "end": point(*start, (-1.0, 0.0, 0.0)),
        },
        {"on_side": IDENTITY},
    )


@family({"length": Size(0.2, 0.16, 0.24), "handle": Size(0.014, 0.012, 0.016)})
def screwdriver(length: float, handle: float) -> Made:
    """A screwdriver that lies, with a hexagonal handle."""
    grip, z = 0.45 * length, handle * cos(pi / 6)
    return Made(
        [
            hexagon((-length / 2, 0.0, z), grip, handle, RED_PLASTIC),
            rod((-length / 2 + grip, 0.0, z), (length / 2, 0.0, z), 0.0025, STEEL),
        ],
        [
            *grips(
                (-length / 2 + grip / 2, 0.0, z),
                ALONG,
                UP,
                2 * z,
                "handle",
                offsets=(-0.012, 0.0, 0.012),
                tilts=around(6, pi / 6, 2 * pi + pi / 6),
            ),
            *grips(
                (-length / 2 + grip + 0.02, 0.0, z),
                ALONG,
                UP,
                0.005,
                "shank",
                offsets=(-0.006, 0.006, 0.018),
                tilts=around(8),
            ),
        ],
        {"tip": point(length / 2, 0.0, z, ALONG)},
        {"lying": IDENTITY},
    )


@family({"length": Size(0.22, 0.18, 0.28), "bowl": Size(0.03, 0.025, 0.036)})
def spoon(length: float, bowl: float) -> Made:
    """A wooden spoon that lies, with a flat round bowl."""
    thick = 0.012
    wide = [
        (round(-length / 2 + bowl + bowl * cos(a), 9), round(0.75 * bowl * sin(a), 9))
        for a in around(12)
    ]
    return Made(
        [
            prism(wide, 0.0, thick, WOOD),
            block(
                (length - 2 * bowl + 0.004, 0.012, thick),
                (bowl - 0.002, 0.0, thick / 2),
                WOOD,
            ),
        ],
        grips(
            (bowl + 0.1 * length, 0.0, thick / 2),
            ALONG,
            UP,
            0.012,
            "handle",
            offsets=(-0.05, -0.035, -0.02, -0.005),
            pitches=(-0.3, 0.0, 0.3),
        ),
        {
            "bowl": point(-length / 2 + bowl, 0.0, thick),
            "end": point(length / 2, 0.0, thick / 2, ALONG),
        },
        {"lying": IDENTITY},
    )
