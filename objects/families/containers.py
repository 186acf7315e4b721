"""Containers and carriers: boxes with lids, pallets, racks, totes, trays."""

from __future__ import annotations

from math import pi

from objects.families.making import (
    CARDBOARD,
    DARK_WOOD,
    DEEP,
    DOWN,
    PLASTIC,
    UP,
    WOOD,
    block,
    edges,
    grips,
    loop,
    point,
    walls,
)
from objects.family import Made, Size, family

SHARES = (-0.6, -0.2, 0.2, 0.6)  # of half a wall: where it is held

BOX = {
    "length": Size(0.16, 0.13, 0.2),
    "width": Size(0.12, 0.1, 0.14),
    "height": Size(0.08, 0.06, 0.1),
}


@family(BOX)
def box(length: float, width: float, height: float) -> Made:
    """An open box."""
    wall = 0.004
    return Made(
        [
            block((length, width, wall), (0.0, 0.0, wall / 2), CARDBOARD),
            *walls(length, width, wall, height, wall, CARDBOARD),
        ],
        edges(length, width, height - DEEP, wall, SHARES),
        {"opening": point(0.0, 0.0, height), "inside": point(0.0, 0.0, wall)},
    )


@family(BOX, fits="box")
def box_lid(length: float, width: float, height: float) -> Made:
    """The lid of an open box; it goes over its walls."""
    wall, gap, rim = 0.003, 0.002, 0.022
    long, wide = length + 2 * (wall + gap), width + 2 * (wall + gap)
    knob = block((0.05, 0.012, 0.02), (0.0, 0.0, rim + wall + 0.01), DARK_WOOD)
    return Made(
        [
            *walls(long, wide, 0.0, rim, wall, CARDBOARD),
            block((long, wide, wall), (0.0, 0.0, rim + wall / 2), CARDBOARD),
            knob,
        ],
        grips(
            (0.0, 0.0, rim + wall + 0.013),
            (1.0, 0.0, 0.0),
            UP,
            0.012,
            "knob",
            offsets=(-0.012, 0.0, 0.012),
            pitches=(-0.4, -0.2, 0.0, 0.2, 0.4),
        ),
        {"opening": point(0.0, 0.0, 0.0, DOWN), "knob": point(0.0, 0.0, rim + wall + 0.02)},
    )


@family(
    {
        "length": Size(0.36, 0.3, 0.42),
        "width": Size(0.24, 0.2, 0.28),
        "rim": Size(0.025, 0.02, 0.035),
    }
)
def tray(length: float, width: float, rim: float) -> Made:
    """A tray with a handle at each end, for two hands."""
    wall, floor, depth = 0.006, 0.005, 0.034
    at = 0.6 * rim
    handles = [
        part
        for side in (1.0, -1.0)
        for part in loop(
            (side * (length / 2 - 0.001), 0.0, at),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            depth,
            0.1,
            0.012,
            DARK_WOOD,
        )
    ]
    grasps = [
        grasp
        for side, name in ((1.0, "right handle"), (-1.0, "left handle"))
        for grasp in grips(
            (side * (length / 2 - 0.001 + depth), 0.0, at),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            0.012,
            name,
            offsets=(-0.02, 0.0, 0.02),
            tilts=(0.0, -side * pi / 2),
            pitches=(-0.2, 0.2),
        )
    ]
    return Made(
        [
            block((length, width, floor), (0.0, 0.0, floor / 2), WOOD),
            *walls(length, width, floor, rim, wall, WOOD),
            *handles,
        ],
        grasps,
        {
            "middle": point(0.0, 0.0, floor),
            "left_handle": point(-length / 2 - depth, 0.0, at, (-1.0, 0.0, 0.0)),
            "right_handle": point(length / 2 + depth, 0.0, at, (1.0, 0.0, 0.0)),
        },
    )


@family(
    {
        "length": Size(0.3, 0.25, 0.36),
        "width": Size(0.2, 0.17, 0.24),
        "height": Size(0.12, 0.1, 0.15),
    }
)
def tote(length: float, width: float, height: float) -> Made:
    """A deep tote with ledges at its ends."""
    wall, ledge, thick = 0.005, 0.03, 0.008
    ledges = [
        block(
            (ledge, 0.6 * width, thick),
            (side * (length + ledge) / 2, 0.0, height - thick / 2),
            PLASTIC,
        )
        for side in (-1, 1)
    ]
    grasps = [
        grasp
        for side, name in ((1.0, "right ledge"), (-1.0, "left ledge"))
        for grasp in grips(
            (side * (length / 2 + 0.6 * ledge), 0.0, height - thick / 2),
            (0.0, 1.0, 0.0),
            (side, 0.0, 0.0),
            thick,
            name,
            offsets=(-0.2 * width, 0.0, 0.2 * width),
            pitches=(-0.2, 0.2),
        )
    ]
    return Made(
        [
            block((length, width, wall), (0.0, 0.0, wall / 2), PLASTIC),
            *walls(length, width, wall, height, wall, PLASTIC),
            *ledges,
        ],
        [*grasps, *edges(length, width, height - DEEP, wall, (-0.5, 0.5))[:8]],
        {"opening": point(0.0, 0.0, height), "inside": point(0.0, 0.0, wall)},
    )


@family({"length": Size(0.24, 0.2, 0.28), "width": Size(0.1, 0.08, 0.12)})
def rack(length: float, width: float) -> Made:
    """A rack whose upright bars hold plates or boards."""
    thick, high, bars = 0.012, 0.09, 6
    pitch = (length - thick) / (bars - 1)
    across = width / 2 - thick / 2
    uprights = [
        block(
            (thick, thick, high),
            (-length / 2 + thick / 2 + i * pitch, side * across, thick + high / 2),
            WOOD,
        )
        for i in range(bars)
        for side in (-1, 1)
    ]
    return Made(
        [
            *(
                block((length, thick, thick), (0.0, side * across, thick / 2), WOOD)
                for side in (-1, 1)
            ),
            *(
                block((thick, width - 2 * thick, thick), (x, 0.0, thick / 2), WOOD)
                for x in (-length / 2 + thick / 2, length / 2 - thick / 2)
            ),
            *uprights,
        ],
        [
            grasp
            for i in range(1, bars - 1)
            for side in (-1, 1)
            for grasp in grips(
                (-length / 2 + thick / 2 + i * pitch, side * across, thick + high - 0.02),
                (1.0, 0.0, 0.0),
                UP,
                thick,
                "upright",
                pitches=(0.0, side * 0.25),
            )
        ],
        {
            f"slot_{i + 1}": point(-length / 2 + thick / 2 + (i + 0.5) * pitch, 0.0, thick)
            for i in range(bars - 1)
        },
    )


@family({"length": Size(0.3, 0.26, 0.36), "width": Size(0.2, 0.18, 0.24)})
def pallet(length: float, width: float) -> Made:
    """A pallet of boards on blocks, a quarter as long as one for lorries."""
    board, block_height, planks = 0.006, 0.024, 5
    plank = 0.13 * width
    step = (width - plank) / (planks - 1)
    rows = (-width / 2 + plank / 2, 0.0, width / 2 - plank / 2)
    columns = (-length / 2 + 0.02, 0.0, length / 2 - 0.02)
    deck = block_height + 2 * board
    return Made(
        [
            *(block((length, plank, board), (0.0, y, board / 2), WOOD) for y in rows),
            *(
                block((0.04, plank, block_height), (x, y, board + block_height / 2), WOOD)
                for x in columns
                for y in rows
            ),
            *(
                block((0.04, width, board), (x, 0.0, board * 1.5 + block_height), WOOD)
                for x in columns
            ),
            *(
                block(
                    (length, plank, board),
                    (0.0, -width / 2 + plank / 2 + i * step, deck + board / 2),
                    WOOD,
                )
                for i in range(planks)
            ),
        ],
        [
            grasp
            for y in rows
            for side in (-1.0, 1.0)
            for grasp in grips(
                (side * (length / 2 - 0.012), y, (deck + board) / 2),
                (0.0, 1.0, 0.0),
                (side, 0.0, 0.0),
                deck + board,
                "end",
                offsets=(0.0,),
                pitches=(-0.1, 0.1),
            )
        ],
        {"deck": point(0.0, 0.0, deck + board)},
    )
