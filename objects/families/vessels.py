"""Vessels: bottles, bowls, cans, cups, jugs, mugs, pans, plates, pots, and their lids."""

from __future__ import annotations

from math import pi

from objects.families.making import (
    ALUMINIUM,
    CERAMIC,
    DARK_WOOD,
    DOWN,
    FLAT,
    GLAZE,
    GREY_PLASTIC,
    MELAMINE,
    ON_SIDE,
    OVER,
    PLASTIC,
    RED_PLASTIC,
    SECTIONS,
    TIN,
    UP,
    around,
    block,
    disc,
    from_above,
    grips,
    loop,
    point,
    rim,
    rod,
    shell,
    taper,
    tube,
)
from objects.family import Made, Size, family
from robots.descriptor import IDENTITY

SIDES = (
    -pi / 2,
    0.0,
    pi / 2,
)  # rad; tilts of a gripper at a square bar
LEAN = (-0.5, 0.0, 0.5)  # rad; tilts of a gripper at a round bar

BOTTLE = {
    "radius": Size(0.032, 0.026, 0.036),
    "height": Size(0.18, 0.15, 0.22),
    "neck": Size(0.014, 0.012, 0.016),
}
POT = {
    "radius": Size(0.1, 0.085, 0.12),
    "height": Size(0.1, 0.08, 0.13),
    "wall": Size(0.004, 0.0035, 0.005),
}


def _upright_or_over() -> dict[str, tuple[float, float, float, float]]:
    return {"upright": IDENTITY, "upside_down": OVER}


@family(
    {
        "radius": Size(0.04, 0.034, 0.045),
        "height": Size(0.095, 0.08, 0.115),
        "wall": Size(0.004, 0.0035, 0.005),
    }
)
def mug(radius: float, height: float, wall: float) -> Made:
    """A mug with a handle."""
    floor, depth, long = 1.25 * wall, 0.03, 0.6 * height
    root, out = (radius - 0.3 * wall, 0.0, 0.52 * height), (1.0, 0.0, 0.0)
    handle = loop(root, UP, out, depth, long, 0.01, GLAZE)
    grip = (root[0] + depth, 0.0, root[2])
    return Made(
        [
            disc(radius, 0.0, floor, GLAZE),
            *shell((radius, floor), (radius, height), wall, GLAZE),
            *handle,
        ],
        [
            *grips(grip, UP, out, 0.01, "handle", offsets=(-0.008, 0.008), tilts=SIDES),
            *rim((radius, floor), (radius, height), wall, range(3, 13)),
        ],
        {
            "rim": point(0.0, 0.0, height),
            "bottom": point(0.0, 0.0, 0.0, DOWN),
            "handle": point(*grip, out),
        },
        _upright_or_over(),
    )


@family(
    {
        "bottom": Size(0.028, 0.024, 0.032),
        "top": Size(0.038, 0.034, 0.042),
        "height": Size(0.1, 0.085, 0.12),
    }
)
def cup(bottom: float, top: float, height: float) -> Made:
    """A cup that widens to its rim, without a handle."""
    wall, floor = 0.004, 0.004
    low, high = (bottom, floor), (top, height)
    return Made(
        [disc(bottom, 0.0, floor, RED_PLASTIC), *shell(low, high, wall, RED_PLASTIC)],
        rim(low, high, wall, range(SECTIONS)),
        {"rim": point(0.0, 0.0, height), "bottom": point(0.0, 0.0, 0.0, DOWN)},
        _upright_or_over(),
    )


@family({"radius": Size(0.08, 0.065, 0.095), "height": Size(0.06, 0.045, 0.07)})
def bowl(radius: float, height: float) -> Made:
    """A round bowl."""
    wall, floor, foot = 0.006, 0.006, 0.5 * radius
    low, middle, high = (foot, floor / 2), (0.85 * radius, 0.45 * height), (radius, height)
    return Made(
        [
            disc(foot, 0.0, floor, CERAMIC),
            *shell(low, middle, wall, CERAMIC),
            *shell(middle, high, wall, CERAMIC),
        ],
        rim(middle, high, wall, range(SECTIONS)),
        {"rim": point(0.0, 0.0, height), "bottom": point(0.0, 0.0, 0.0, DOWN)},
        _upright_or_over(),
    )


@family({"radius": Size(0.1, 0.085, 0.12), "height": Size(0.022, 0.018, 0.026)})
def plate(radius: float, height: float) -> Made:
    """A plate with a raised rim."""
    wall, floor, flat = 0.012, 0.005, 0.62 * radius
    low, high = (flat, 0.001), (radius, height)
    return Made(
        [disc(flat - wall, 0.0, floor, MELAMINE), *shell(low, high, wall, MELAMINE)],
        rim(low, high, wall, range(SECTIONS), deep=0.016),
        {"middle": point(0.0, 0.0, floor), "bottom": point(0.0, 0.0, 0.0, DOWN)},
    )


@family(POT)
def pot_two_handles(radius: float, height: float, wall: float) -> Made:
    """A pot with a handle at each side, for two hands."""
    depth, at = 0.035, 0.8 * height
    root = radius - 0.3 * wall
    bar = root + depth
    handles = [
        part
        for side in (1.0, -1.0)
        for part in loop(
            (side * root, 0.0, at),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            depth,
            0.085,
            0.012,
            GREY_PLASTIC,
        )
    ]
    grasps = [
        grasp
        for side, name in ((1.0, "right handle"), (-1.0, "left handle"))
        for grasp in grips(
            (side * bar, 0.0, at),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            0.012,
            name,
            offsets=(-0.015, 0.0, 0.015),
            tilts=(0.0, -side * pi / 2),
        )
    ]
    return Made(
        [
            disc(radius, 0.0, wall, ALUMINIUM),
            *shell((radius, wall), (radius, height), wall, ALUMINIUM),
            *handles,
        ],
        [*grasps, *rim((radius, wall), (radius, height), wall, (3, 4, 11, 12))],
        {
            "rim": point(0.0, 0.0, height),
            "bottom": point(0.0, 0.0, 0.0, DOWN),
            "left_handle": point(-bar, 0.0, at, (-1.0, 0.0, 0.0)),
            "right_handle": point(bar, 0.0, at, (1.0, 0.0, 0.0)),
        },
    )


@family(POT, fits="pot_two_handles")
def pot_lid(radius: float, height: float, wall: float) -> Made:
    """The lid of a pot with two handles, with a knob."""
    inner, thick, knob = FLAT * radius - wall - 0.003, 0.004, 0.012
    top = thick + 0.016
    return Made(
        [
            disc(radius, 0.0, thick, ALUMINIUM),
            *tube((inner - 0.004, inner, -0.006), (inner - 0.004, inner, 0.0), ALUMINIUM),
            disc(0.6 * knob, thick, top, GREY_PLASTIC),
            disc(knob, top, top + 0.016, GREY_PLASTIC),
        ],
        from_above(top + 0.008, 2 * knob, "knob", around(12, 0.0, pi)),
        {"knob": point(0.0, 0.0, top + 0.016), "bottom": point(0.0, 0.0, -0.006, DOWN)},
    )


@family({"radius": Size(0.1, 0.085, 0.115), "handle": Size(0.15, 0.12, 0.17)})
def pan(radius: float, handle: float) -> Made:
    """A flat pan with one long handle."""
    wall, height = 0.003, 0.04
    start, end = (radius - 0.001, 0.0, 0.03), (radius + handle, 0.0, 0.045)
    middle = (radius + 0.5 * handle, 0.0, 0.0375)
    along = (handle, 0.0, 0.015)
    length = (handle**2 + 0.015**2) ** 0.5
    along = (along[0] / length, 0.0, along[2] / length)
    return Made(
        [
            disc(radius, 0.0, wall, ALUMINIUM),
            *shell((radius, wall), (radius, height), wall, ALUMINIUM),
            rod(start, end, 0.009, DARK_WOOD),
        ],
        grips(
            middle,
            along,
            (-along[2], 0.0, along[0]),
            0.018,
            "handle",
            offsets=(-0.3 * handle, -0.1 * handle, 0.1 * handle, 0.3 * handle),
            tilts=LEAN,
        ),
        {"middle": point(0.0, 0.0, wall), "handle": point(*end, (1.0, 0.0, 0.0))},
    )


@family(
    {
        "radius": Size(0.055, 0.048, 0.062),
        "height": Size(0.15, 0.125, 0.17),
    }
)
def jug(radius: float, height: float) -> Made:
    """A jug with a handle and a spout."""
    wall, floor, depth = 0.004, 0.005, 0.036
    root, out = (-radius + 0.3 * wall, 0.0, 0.52 * height), (-1.0, 0.0, 0.0)
    grip = (root[0] - depth, 0.0, root[2])
    lip = [
        block((0.022, 0.003, 0.02), (radius + 0.008, side * 0.011, height - 0.01), PLASTIC)
        for side in (-1, 1)
    ]
    return Made(
        [
            disc(radius, 0.0, floor, PLASTIC),
            *shell((radius, floor), (radius, height), wall, PLASTIC),
            *loop(root, UP, out, depth, 0.65 * height, 0.012, PLASTIC),
            block((0.022, 0.025, 0.003), (radius + 0.008, 0.0, height - 0.0215), PLASTIC),
            *lip,
        ],
        grips(
            grip,
            UP,
            out,
            0.012,
            "handle",
            offsets=(-0.021, -0.007, 0.007, 0.021),
            tilts=SIDES,
        ),
        {
            "spout": point(radius + 0.019, 0.0, height - 0.02, (1.0, 0.0, 0.0)),
            "rim": point(0.0, 0.0, height),
            "handle": point(*grip, out),
            "bottom": point(0.0, 0.0, 0.0, DOWN),
        },
    )


@family(BOTTLE)
def bottle(radius: float, height: float, neck: float) -> Made:
    """A bottle with a round body and a neck."""
    body, shoulder = 0.68 * height, 0.8 * height
    return Made(
        [
            disc(radius, 0.0, body, PLASTIC),
            taper(radius, body, neck, shoulder, PLASTIC),
            disc(neck, shoulder, height, PLASTIC),
        ],
        [
            *grips(
                (0.0, 0.0, height - 0.016),
                UP,
                (1.0, 0.0, 0.0),
                2 * neck,
                "neck",
                tilts=around(6),
            ),
            *grips(
                (0.0, 0.0, 0.5 * body),
                UP,
                (1.0, 0.0, 0.0),
                2 * radius,
                "body",
                offsets=(-0.02, 0.02),
                tilts=around(6),
            ),
        ],
        {"mouth": point(0.0, 0.0, height), "bottom": point(0.0, 0.0, 0.0, DOWN)},
        {"upright": IDENTITY, "lying": ON_SIDE},
    )


@family(BOTTLE, fits="bottle")
def bottle_cap(radius: float, height: float, neck: float) -> Made:
    """The cap of a bottle, open below; it goes over the neck."""
    inner, top, wall = neck + 0.001, 0.02, 0.003
    outer = inner + wall + 0.001
    return Made(
        [
            *tube((inner, outer, 0.0), (inner, outer, top), RED_PLASTIC),
            disc(outer - 0.0005, top, top + wall, RED_PLASTIC),
        ],
        grips(
            (0.0, 0.0, 0.6 * top),
            UP,
            (1.0, 0.0, 0.0),
            2 * outer * FLAT,
            "side",
            tilts=[angle + pi / 16 for angle in around(8)],
        )
        + from_above(0.6 * top, 2 * outer * FLAT, "side", around(8, pi / 16, pi + pi / 16)),
        {"opening": point(0.0, 0.0, 0.0, DOWN), "top": point(0.0, 0.0, top + wall)},
        _upright_or_over(),
    )


@family({"radius": Size(0.033, 0.026, 0.037), "height": Size(0.11, 0.08, 0.13)})
def can(radius: float, height: float) -> Made:
    """A full can."""
    sides = grips(
        (0.0, 0.0, height / 2),
        UP,
        (1.0, 0.0, 0.0),
        2 * radius,
        "body",
        offsets=(-0.2 * height, 0.0, 0.2 * height),
        tilts=around(6),
    )
    return Made(
        [disc(radius, 0.0, height, TIN)],
        sides + from_above(height - 0.025, 2 * radius, "body", around(6, 0.0, pi)),
        {"top": point(0.0, 0.0, height), "bottom": point(0.0, 0.0, 0.0, DOWN)},
        {"upright": IDENTITY, "lying": ON_SIDE},
    )
