"""What is worked by hand: valves, dials, buttons, switches, levers, taps, bolts, cranks."""

from __future__ import annotations

from math import cos, pi, sin

from objects.families.furniture import FRONT, SIDE, TILTS, handle
from objects.families.making import (
    DARK_WOOD,
    GREY_PLASTIC,
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
    point,
    polygon,
    prism,
    rod,
    tube,
)
from objects.family import Made, Size, family
from objects.joints import Joint

GAP = 0.001  # m
FACES = around(4, pi / 8, 9 * pi / 8)  # rad; of an octagon
PITCHES = (-0.3, 0.0, 0.3)  # rad
NEAR = (-0.008, 0.008)  # m


@family({"radius": Size(0.07, 0.055, 0.085), "height": Size(0.12, 0.1, 0.16)})
def valve(radius: float, height: float) -> Made:
    """A valve whose wheel turns about a standing stem, twice round from shut to open."""
    rim = (radius - 0.012, radius)
    spokes = [
        rod((0.0, 0.0, height), (0.94 * x, 0.94 * y, height), 0.005, STEEL)
        for x, y in polygon(radius, 3)
    ]
    wheel = tube((*rim, height - 0.007), (*rim, height + 0.007), RED_PLASTIC)
    held = [
        grasp
        for a in (pi / 3, pi, 5 * pi / 3)
        for grasp in grips(
            ((radius - 0.006) * cos(a), (radius - 0.006) * sin(a), height),
            (-sin(a), cos(a), 0.0),
            UP,
            0.012,
            "wheel",
            tilts=TILTS,
        )
    ]
    return Made(
        [
            block((0.12, 0.12, 0.03), (0.0, 0.0, 0.015), GREY_PLASTIC),
            disc(0.016, 0.03, height - 0.012, STEEL),
        ],
        held,
        {"hub": point(0.0, 0.0, height + 0.007)},
        joints=[
            Joint(
                name="wheel",
                kind="turn",
                parts=(*wheel, *spokes, disc(0.012, height - 0.006, height + 0.008, STEEL)),
                axis=UP,
                upper=round(4 * pi, 4),
                damping=0.02,
            )
        ],
    )


@family({"radius": Size(0.024, 0.018, 0.03), "height": Size(0.06, 0.05, 0.08)})
def dial(radius: float, height: float) -> Made:
    """A dial on a panel that lies; it turns by three quarters."""
    low, high = height + GAP, height + GAP + 0.025
    pointer = block((0.01, 0.004, 0.004), (radius - 0.006, 0.0, high + 0.002), RED_PLASTIC)
    return Made(
        [block((0.14, 0.1, height), (0.0, 0.0, height / 2), GREY_PLASTIC)],
        from_above((low + high) / 2 + 0.003, 2 * radius * cos(pi / 8), "knob", FACES, PITCHES),
        {"top": point(0.0, 0.0, high)},
        joints=[
            Joint(
                name="knob",
                kind="turn",
                parts=(prism(polygon(radius, 8), low, high, PLASTIC), pointer),
                axis=UP,
                upper=round(1.5 * pi, 4),
                damping=0.005,
            )
        ],
    )


@family({"radius": Size(0.022, 0.016, 0.03), "travel": Size(0.01, 0.006, 0.014)})
def button(radius: float, travel: float) -> Made:
    """A button that a spring pushes up."""
    low = 0.03 + travel
    return Made(
        [
            block((0.09, 0.09, 0.03), (0.0, 0.0, 0.015), GREY_PLASTIC),
            *tube(
                (radius + 0.002, radius + 0.008, 0.03),
                (radius + 0.002, radius + 0.008, low),
                GREY_PLASTIC,
            ),
        ],
        points={"top": point(0.0, 0.0, low + 0.012)},
        joints=[
            Joint(
                name="cap",
                kind="slide",
                parts=(disc(radius, low - 0.006, low + 0.012, RED_PLASTIC),),
                axis=(0.0, 0.0, -1.0),
                upper=round(travel - 0.002, 4),
                damping=2.0,
                stiffness=300.0,
                rest=-0.004,
            )
        ],
    )


@family({"length": Size(0.05, 0.04, 0.06), "height": Size(0.05, 0.04, 0.06)})
def rocker(length: float, height: float) -> Made:
    """A rocker switch, off; it is tipped by pressing on its raised end."""
    z = height + 0.012
    tip = block((length, 0.024, 0.008), (0.0, 0.0, z), RED_PLASTIC)
    return Made(
        [
            block((0.1, 0.07, height), (0.0, 0.0, height / 2), GREY_PLASTIC),
        ],
        points={"on": point(length / 2, 0.0, z), "off": point(-length / 2, 0.0, z)},
        joints=[
            Joint(
                name="rocker",
                kind="turn",
                parts=(tip,),
                axis=SIDE,
                at=(0.0, 0.0, z),
                lower=-0.22,
                upper=0.22,
                start=-0.22,
                friction=0.02,
                damping=0.004,
            )
        ],
    )


@family({"length": Size(0.14, 0.11, 0.17), "height": Size(0.08, 0.06, 0.1)})
def lever(length: float, height: float) -> Made:
    """A lever that is thrown from one side to the other."""
    knob = height + length
    cheeks = [
        block((0.06, 0.012, height), (0.0, side, height / 2), GREY_PLASTIC)
        for side in (-0.022, 0.022)
    ]
    return Made(
        [block((0.14, 0.08, 0.012), (0.0, 0.0, 0.006), GREY_PLASTIC), *cheeks],
        grips((0.0, 0.0, knob - 0.02), UP, FRONT, 0.024, "lever", offsets=NEAR, tilts=TILTS)
        + grips((0.0, 0.0, knob - 0.02), SIDE, UP, 0.024, "lever", tilts=TILTS),
        {"knob": point(0.0, 0.0, knob + 0.01)},
        joints=[
            Joint(
                name="lever",
                kind="turn",
                parts=(
                    rod((0.0, 0.0, height - 0.01), (0.0, 0.0, knob - 0.05), 0.007, STEEL),
                    block((0.024, 0.024, 0.06), (0.0, 0.0, knob - 0.02), RED_PLASTIC),
                ),
                axis=SIDE,
                at=(0.0, 0.0, height - 0.01),
                lower=-0.8,
                upper=0.8,
                start=-0.8,
                damping=0.05,
            )
        ],
    )


@family({"reach": Size(0.12, 0.1, 0.15), "height": Size(0.16, 0.13, 0.2)})
def tap(reach: float, height: float) -> Made:
    """A tap whose handle turns by a quarter."""
    top = height + GAP
    return Made(
        [
            disc(0.05, 0.0, 0.012, STEEL),
            disc(0.018, 0.012, height, STEEL),
            rod((0.0, 0.0, height - 0.03), (reach, 0.0, height - 0.03), 0.01, STEEL),
        ],
        grips((0.035, 0.0, top + 0.012), FRONT, UP, 0.016, "handle", offsets=NEAR, tilts=TILTS),
        {"spout": point(reach, 0.0, height - 0.04, (0.0, 0.0, -1.0))},
        joints=[
            Joint(
                name="handle",
                kind="turn",
                parts=(
                    disc(0.016, top, top + 0.02, STEEL),
                    block((0.07, 0.016, 0.012), (0.045, 0.0, top + 0.012), RED_PLASTIC),
                ),
                axis=UP,
                upper=round(pi / 2, 4),
                damping=0.02,
            )
        ],
    )


@family({"travel": Size(0.06, 0.05, 0.08), "height": Size(0.05, 0.04, 0.07)})
def latch(travel: float, height: float) -> Made:
    """A bolt that slides in two guides."""
    z, long = height + 0.02, travel + 0.14
    guides = [
        block((0.02, 0.012, 0.03), (x, side, height + 0.015), STEEL)
        for x in (-0.05, 0.03)
        for side in (-0.018, 0.018)
    ]
    knob = block((0.014, 0.014, 0.05), (-0.01, 0.0, z + 0.03), RED_PLASTIC)
    return Made(
        [block((long + travel, 0.1, height), (0.0, 0.0, height / 2), WOOD), *guides],
        grips((-0.01, 0.0, z + 0.04), FRONT, UP, 0.014, "bolt", tilts=TILTS, pitches=PITCHES),
        {"end": point(0.06, 0.0, z, FRONT)},
        joints=[
            Joint(
                name="bolt",
                kind="slide",
                parts=(block((0.14, 0.02, 0.02), (-0.01, 0.0, z), STEEL), knob),
                axis=FRONT,
                upper=round(travel, 4),
                damping=2.0,
            )
        ],
    )


@family({"radius": Size(0.07, 0.055, 0.085), "height": Size(0.1, 0.08, 0.13)})
def crank(radius: float, height: float) -> Made:
    """A crank with a standing handle, which turns round and round."""
    z = height + GAP
    return Made(
        [block((0.12, 0.12, height), (0.0, 0.0, height / 2), WOOD)],
        grips((radius, 0.0, z + 0.06), FRONT, UP, 0.024, "arm", tilts=TILTS)
        + grips((radius, 0.0, z + 0.06), SIDE, UP, 0.024, "arm", tilts=TILTS),
        {"top": point(radius, 0.0, z + 0.086)},
        joints=[
            Joint(
                name="arm",
                kind="turn",
                parts=(
                    block((radius + 0.03, 0.024, 0.016), (radius / 2, 0.0, z + 0.008), STEEL),
                    block((0.024, 0.024, 0.07), (radius, 0.0, z + 0.051), DARK_WOOD),
                ),
                axis=UP,
                lower=-100.0,
                upper=100.0,
                damping=0.02,
            )
        ],
    )


@family({"radius": Size(0.14, 0.11, 0.17), "height": Size(0.04, 0.03, 0.05)})
def turntable(radius: float, height: float) -> Made:
    """A plate that turns freely on a foot."""
    return Made(
        [disc(0.5 * radius, 0.0, height, GREY_PLASTIC)],
        points={"top": point(0.0, 0.0, height + GAP + 0.012)},
        joints=[
            Joint(
                name="plate",
                kind="turn",
                parts=(disc(radius, height + GAP, height + GAP + 0.012, WOOD),),
                axis=UP,
                lower=-100.0,
                upper=100.0,
                damping=0.01,
            )
        ],
    )


@family({"travel": Size(0.08, 0.06, 0.1), "height": Size(0.14, 0.12, 0.18)})
def toaster(travel: float, height: float) -> Made:
    """A toaster whose slide is pressed down against a spring."""
    x = 0.095 + GAP
    return Made(
        [
            block((0.19, 0.16, height), (0.0, 0.0, height / 2), GREY_PLASTIC),
        ],
        points={"slide": point(x + 0.02, 0.0, height - 0.01)},
        joints=[
            Joint(
                name="slide",
                kind="slide",
                parts=(block((0.04, 0.03, 0.012), (x + 0.02, 0.0, height - 0.016), RED_PLASTIC),),
                axis=(0.0, 0.0, -1.0),
                upper=round(travel, 4),
                damping=2.0,
                stiffness=60.0,
                rest=-0.01,
            )
        ],
    )


@family({"length": Size(0.4, 0.32, 0.46), "height": Size(0.1, 0.08, 0.12)})
def seesaw(length: float, height: float) -> Made:
    """A beam that tips about its middle."""
    z = height + 0.01
    cheeks = [
        block((0.04, 0.012, height + 0.02), (0.0, side, height / 2 + 0.01), DARK_WOOD)
        for side in (-0.05, 0.05)
    ]
    return Made(
        [block((0.16, 0.14, 0.012), (0.0, 0.0, 0.006), DARK_WOOD), *cheeks],
        points={"left": point(-length / 2, 0.0, z), "right": point(length / 2, 0.0, z)},
        joints=[
            Joint(
                name="beam",
                kind="turn",
                parts=(block((length, 0.08, 0.012), (0.0, 0.0, z), WOOD),),
                axis=SIDE,
                at=(0.0, 0.0, z),
                lower=-0.35,
                upper=0.35,
                damping=0.01,
            )
        ],
    )


@family({"length": Size(0.26, 0.22, 0.3), "height": Size(0.05, 0.04, 0.07)})
def slider(length: float, height: float) -> Made:
    """A slider on a rail, as on a mixing desk."""
    z = height + GAP
    travel = length - 0.06
    cap = block((0.02, 0.026, 0.03), (-travel / 2, 0.0, z + 0.015), PLASTIC)
    return Made(
        [block((length, 0.09, height), (0.0, 0.0, height / 2), GREY_PLASTIC)],
        grips(
            (-travel / 2, 0.0, z + 0.02),
            SIDE,
            UP,
            0.02,
            "cap",
            tilts=TILTS,
            pitches=PITCHES,
        ),
        {"cap": point(-travel / 2, 0.0, z + 0.03)},
        joints=[
            Joint(
                name="cap",
                kind="slide",
                parts=(cap,),
                axis=FRONT,
                upper=round(travel, 4),
                damping=2.0,
            )
        ],
    )


@family({"width": Size(0.3, 0.26, 0.36), "height": Size(0.3, 0.26, 0.34)})
def gate(width: float, height: float) -> Made:
    """A small door in a frame that a spring shuts: it must be held."""
    thick = 0.03
    frame = [
        block(size, (0.0, side * (width + thick) / 2, size[2] / 2), WOOD)
        for size in ((0.05, thick, height), (0.2, thick, 0.016))
        for side in (-1, 1)
    ]
    pull = handle((0.006, width / 2 - 0.04, height / 2), UP, FRONT, 0.1, "leaf")
    leaf = block((0.012, width - 0.006, height - 0.04), (0.0, 0.0, height / 2 + 0.01), DARK_WOOD)
    return Made(
        [*frame, block((0.05, width, thick), (0.0, 0.0, height + thick / 2), WOOD)],
        pull.grasps,
        {"passage": point(0.0, 0.0, height / 2, FRONT)},
        joints=[
            Joint(
                name="leaf",
                kind="turn",
                parts=(leaf, *pull.parts),
                axis=(0.0, 0.0, -1.0),
                at=(0.0, -width / 2, 0.0),
                upper=1.6,
                damping=0.2,
                stiffness=0.4,
                rest=-0.1,
            )
        ],
    )
