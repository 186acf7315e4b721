"""What families are put together from: materials, convex parts, grasps.

Lengths are in metres. Coordinates are rounded to a nanometre, so that a mathematics library that
rounds otherwise in the last bit changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import cos, hypot, pi, sin
from typing import TypedDict

import numpy as np

from objects.descriptor import Grasp, NamedPoint
from objects.shapes import Box, Color, ConvexHull, Cylinder, Finish, Friction, Place, Shape, linear
from objects.solids import rounded_place, rounded_turn
from robot_layouts.kinematics.rotations import Floats, cross, quaternion_of, rotation_about
from robots.descriptor import IDENTITY, Quaternion

Axis = tuple[float, float, float]
Ring = tuple[float, float]  # outer radius and height

UP: Axis = (0.0, 0.0, 1.0)
DOWN: Axis = (0.0, 0.0, -1.0)

UPRIGHT: Quaternion = (0.7071067811865476, 0.0, -0.7071067811865476, 0.0)  # from along x to along z
OVER: Quaternion = (0.0, 1.0, 0.0, 0.0)  # upside down, about x
ON_SIDE: Quaternion = (0.7071067811865476, 0.7071067811865476, 0.0, 0.0)  # a quarter turn about x
SECTIONS = 16  # wedges of a ring
FLAT = cos(pi / SECTIONS)  # of a ring's radius: how far its flat faces are from the middle
DEEP = 0.008  # m; how far below an edge fingers hold it
_DIGITS = 9


class Matter(TypedDict):
    """What a part is made of: fields of a `Shape`."""

    density: float
    friction: Friction
    color: Color
    finish: Finish


def matter(density: float, friction: float, code: str, roughness: float = 0.7) -> Matter:
    """Return a material: density (kg/m³), coefficient of friction, colour such as ``"#FFD289"``."""
    red, green, blue = (round(tone, _DIGITS) for tone in linear(code)[:3])
    return Matter(
        density=density,
        friction=Friction(friction, friction),
        color=(red, green, blue, 1.0),
        finish=Finish(roughness=roughness, specular=0.3),
    )


# Densities and coefficients of friction are typical of the kind of material, not measured.
ALUMINIUM = matter(2700, 0.45, "#B8BEC6", 0.3)
CARDBOARD = matter(700, 0.5, "#C59A6B")
CERAMIC = matter(2300, 0.45, "#E9E4D8", 0.4)
CLAY = matter(1900, 0.6, "#A6523A")
GLAZE = matter(2300, 0.45, "#3C6E8F", 0.4)
MELAMINE = matter(1500, 0.45, "#E9E4D8", 0.4)
PLASTIC = matter(950, 0.4, "#2F78C4", 0.5)
RED_PLASTIC = matter(950, 0.4, "#C8412F", 0.5)
GREY_PLASTIC = matter(950, 0.4, "#6E757C", 0.5)
LIGHT_WOOD = matter(450, 0.45, "#B98A54")
STEEL = matter(7850, 0.4, "#8C9299", 0.3)
TIN = matter(1050, 0.4, "#9AA3AD", 0.3)  # full of something to drink
WOOD = matter(650, 0.45, "#B98A54")
DARK_WOOD = matter(700, 0.45, "#7C5230")


def block(size: Axis, middle: Axis, made_of: Matter, turned: Quaternion = IDENTITY) -> Box:
    """Return a box of some lengths along x, y, z about a middle."""
    return Box(
        rounded_place([length / 2 for length in size]),
        position=rounded_place(middle),
        quaternion=turned,
        **made_of,
    )


def disc(radius: float, bottom: float, top: float, made_of: Matter) -> Cylinder:
    """Return an upright cylinder about the z axis."""
    middle = rounded_place((0.0, 0.0, (bottom + top) / 2))
    return Cylinder(
        round(radius, _DIGITS),
        round((top - bottom) / 2, _DIGITS),
        position=middle,
        quaternion=UPRIGHT,
        **made_of,
    )


def rod(start: Axis | Floats, end: Axis | Floats, radius: float, made_of: Matter) -> Cylinder:
    """Return a cylinder between the middles of its ends."""
    along = np.subtract(end, start)
    middle = np.add(start, end) / 2
    length = float(np.linalg.norm(along))
    return Cylinder(
        round(radius, _DIGITS),
        round(length / 2, _DIGITS),
        position=rounded_place(middle),
        quaternion=_turn(along / length),
        **made_of,
    )


def prism(
    outline: Sequence[tuple[float, float]], bottom: float, top: float, made_of: Matter
) -> ConvexHull:
    """Return what stands on a convex outline in x and y."""
    corners = [rounded_place((x, y, z)) for z in (bottom, top) for x, y in outline]
    return ConvexHull(tuple(corners), **made_of)


def taper(low: float, bottom: float, high: float, top: float, made_of: Matter) -> ConvexHull:
    """Return what narrows from one radius at the bottom to another at the top."""
    ends = ((low, bottom), (high, top))
    corners = [rounded_place((x, y, z)) for radius, z in ends for x, y in polygon(radius, SECTIONS)]
    return ConvexHull(tuple(corners), **made_of)


def hexagon(start: Axis, length: float, radius: float, made_of: Matter) -> ConvexHull:
    """Return a hexagonal bar along x from the middle of its end; two of its sides are level."""
    x, y, z = start
    corners = [
        rounded_place((at, y + aside, z + up))
        for at in (x, x + length)
        for aside, up in polygon(radius, 6)
    ]
    return ConvexHull(tuple(corners), **made_of)


def polygon(radius: float, corners: int) -> list[tuple[float, float]]:
    """Return the corners of a regular polygon around the origin, the first one on the x axis."""
    return [(radius * cos(angle), radius * sin(angle)) for angle in around(corners)]


def tube(
    bottom: tuple[float, float, float],
    top: tuple[float, float, float],
    made_of: Matter,
    sections: int = SECTIONS,
) -> list[Shape]:
    """Return an upright ring of convex wedges.

    Args:
        bottom: Inner radius, outer radius, height; the inner one is clear all around.
        top: Likewise.
        made_of: Its material.
        sections: How many wedges, which are corners of its outline.
    """
    ends = [polygon(radius, sections) for radius in (bottom[1], top[1])]
    holes = [polygon(radius / cos(pi / sections), sections) for radius in (bottom[0], top[0])]
    wedges: list[Shape] = []
    for i in range(sections):
        j = (i + 1) % sections
        corners = [
            rounded_place((*ring[at], z))
            for rings, z in zip(zip(holes, ends, strict=True), (bottom[2], top[2]), strict=True)
            for ring in rings
            for at in (i, j)
        ]
        wedges.append(ConvexHull(tuple(corners), **made_of))
    return wedges


def shell(bottom: Ring, top: Ring, wall: float, made_of: Matter) -> list[Shape]:
    """Return a round wall, which may lean.

    Args:
        bottom: Outer radius and height.
        top: Likewise.
        wall: Its thickness, measured level.
        made_of: Its material.
    """
    ends = [(radius * FLAT - wall, radius, height) for radius, height in (bottom, top)]
    return tube(ends[0], ends[1], made_of)


def walls(
    length: float, width: float, bottom: float, top: float, wall: float, made_of: Matter
) -> list[Shape]:
    """Return four upright walls along the edges of a rectangle; none overlap."""
    height, middle = top - bottom, (bottom + top) / 2
    along, across = (length - wall) / 2, (width - wall) / 2
    return [
        *(block((length, wall, height), (0.0, y, middle), made_of) for y in (-across, across)),
        *(
            block((wall, width - 2 * wall, height), (x, 0.0, middle), made_of)
            for x in (-along, along)
        ),
    ]


def bar(start: Axis | Floats, end: Axis | Floats, thick: float, made_of: Matter) -> Box:
    """Return a square bar between the middles of its ends."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    half = (length / 2, thick / 2, thick / 2)
    turned, middle = _turn(along / length), rounded_place(np.add(start, end) / 2)
    return Box(rounded_place(half), position=middle, quaternion=turned, **made_of)


def loop(
    root: Axis, along: Axis, out: Axis, depth: float, length: float, thick: float, made_of: Matter
) -> list[Shape]:
    """Return a handle: a square bar that two arms hold off a surface.

    Args:
        root: Middle of the handle on the surface.
        along: Direction of the bar, of length 1.
        out: Direction away from the surface, of length 1.
        depth: How far the bar's middle is from the surface.
        length: Of the bar.
        thick: Of bar and arms.
        made_of: Their material.
    """
    ends = [np.add(root, np.multiply(along, side * (length - thick) / 2)) for side in (-1, 1)]
    reach, corner = np.multiply(out, depth), np.multiply(along, thick / 2)
    held = bar(ends[0] + reach - corner, ends[1] + reach + corner, thick, made_of)
    tips = [end + np.multiply(out, depth - thick / 2) for end in ends]
    return [held, *(bar(*arm, thick, made_of) for arm in zip(ends, tips, strict=True))]


def grips(
    middle: Axis,
    along: Axis,
    out: Axis,
    width: float,
    part: str,
    *,
    offsets: Sequence[float] = (0.0,),
    tilts: Sequence[float] = (0.0,),
    pitches: Sequence[float] = (0.0,),
) -> list[Grasp]:
    """Return grasps of a bar, a wall or a round body: both ways round, from several sides.

    Args:
        middle: Where the fingers meet.
        along: Direction in which what is held runs on; of length 1, and so is the next.
        out: Where the gripper comes from, at a right angle to that. The fingers close along both's
            normal.
        width: Of what is held.
        part: What it is called.
        offsets: Where along it.
        tilts: Turns of the gripper about ``along`` (rad).
        pitches: Turns about the way in which it closes, after those (rad).
    """
    places, frames, normal = list[Place](), list[Floats](), np.cross(along, out)
    for offset, tilt, pitch in product(offsets, tilts, pitches):
        turned = rotation_about(along, tilt)
        approach, closing = -(turned @ np.array(out)), turned @ normal
        approach = rotation_about(_axis(closing), pitch) @ approach
        for way in (closing, -closing):
            places.append(rounded_place(np.add(middle, np.multiply(along, offset))))
            frames.append(np.stack([cross(way, approach), way, approach], axis=1))
    turns = map(rounded_turn, quaternion_of(np.reshape(frames, (-1, 3, 3))))
    pairs = zip(places, turns, strict=True)
    return [Grasp(place, turn, round(width, _DIGITS), part) for place, turn in pairs]


def from_above(
    height: float,
    width: float,
    part: str,
    angles: Sequence[float],
    pitches: Sequence[float] = (0.0,),
) -> list[Grasp]:
    """Return grasps of an upright round body at the origin, from above.

    Args:
        height: Of the fingers' middle.
        width: Of what is held.
        part: What it is called.
        angles: How the gripper is turned: where its x axis points (rad); half a turn has all.
        pitches: See `grips`.
    """
    return [
        grasp
        for angle in angles
        for grasp in grips(
            (0.0, 0.0, height), (cos(angle), sin(angle), 0.0), UP, width, part, pitches=pitches
        )
    ]


def around(count: int, first: float = 0.0, last: float = 2 * pi) -> list[float]:
    """Return evenly spaced angles from the first on, the last left out (rad)."""
    return [first + (last - first) * i / count for i in range(count)]


def edge(radius: float, height: float, thick: float, part: str) -> list[Grasp]:
    """Return grasps of an upright round body's edge, by its faces: level, from all round.

    Args:
        radius: Where the fingers meet.
        height: Of their middle.
        thick: What is held, from its upper face to its lower one.
        part: What it is called.
    """
    return [
        grasp
        for angle in around(8)
        for grasp in grips(
            (radius * cos(angle), radius * sin(angle), height),
            (-sin(angle), cos(angle), 0.0),
            (cos(angle), sin(angle), 0.0),
            thick,
            part,
        )
    ]


def rim(
    bottom: Ring, top: Ring, wall: float, facets: Sequence[int], deep: float = DEEP
) -> list[Grasp]:
    """Return grasps of the upper edge of a `shell`, along its slope.

    Args:
        bottom: See `shell`.
        top: See `shell`.
        wall: See `shell`.
        facets: Which of its flat faces, counted from the x axis on.
        deep: How far below the edge.
    """
    outward = (top[0] - bottom[0]) * FLAT
    steep = np.array([outward, top[1] - bottom[1]]) / hypot(outward, top[1] - bottom[1])
    aside = np.array([steep[1], -steep[0]])  # out of the wall; both are of radius and height
    wide = wall * float(steep[1])
    radius, height = np.array([top[0] * FLAT, top[1]]) - deep * steep - wide / 2 * aside
    found: list[Grasp] = []
    for facet in facets:
        angle = 2 * pi * (facet + 0.5) / SECTIONS
        c, s = cos(angle), sin(angle)
        out = (float(steep[0]) * c, float(steep[0]) * s, float(steep[1]))
        middle = (float(radius) * c, float(radius) * s, float(height))
        found += grips(middle, (-s, c, 0.0), out, wide, "rim")
    return found


def edges(
    length: float,
    width: float,
    height: float,
    wall: float,
    offsets: Sequence[float],
    part: str = "wall",
) -> list[Grasp]:
    """Return grasps of four upright walls along the edges of a rectangle, from above.

    Args:
        length: Of the rectangle, along x.
        width: Of the rectangle, along y.
        height: Of the fingers' middle.
        wall: Thickness of the walls.
        offsets: Where along each wall, as shares of its half length.
        part: What they are called.
    """
    return [
        grasp
        for side in _sides(length, width, height, wall)
        for grasp in _edge(*side, wall, offsets, part)
    ]


def _sides(
    length: float, width: float, height: float, wall: float
) -> Iterator[tuple[Axis, Axis, float]]:
    x, y = (length - wall) / 2, (width - wall) / 2
    yield from (((0.0, side * y, height), (1.0, 0.0, 0.0), length / 2) for side in (-1, 1))
    yield from (((side * x, 0.0, height), (0.0, 1.0, 0.0), width / 2) for side in (-1, 1))


def _edge(
    middle: Axis, along: Axis, half: float, wall: float, offsets: Sequence[float], part: str
) -> list[Grasp]:
    places = [share * half for share in offsets]
    return grips(middle, along, (0.0, 0.0, 1.0), wall, part, offsets=places)


def yaw(angle: float) -> Quaternion:
    """Return a turn about z (rad), wxyz."""
    return round(cos(angle / 2), _DIGITS), 0.0, 0.0, round(sin(angle / 2), _DIGITS)


def point(x: float, y: float, z: float, away: Axis = (0.0, 0.0, 1.0)) -> NamedPoint:
    """Return a point whose frame's z axis points a way."""
    ahead = np.array(away) / hypot(*away)
    side = np.cross((0.0, 1.0, 0.0) if abs(ahead[1]) < 0.9 else (1.0, 0.0, 0.0), ahead)
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(ahead, side), ahead], axis=1)
    return NamedPoint(rounded_place((x, y, z)), _quaternion(frame))


def _turn(ahead: Floats) -> Quaternion:
    """Return what turns the x axis to a direction, wxyz."""
    side = np.cross((0.0, 0.0, 1.0) if abs(ahead[2]) < 0.9 else (0.0, 1.0, 0.0), ahead)
    side /= np.linalg.norm(side)
    return _quaternion(np.stack([ahead, side, np.cross(ahead, side)], axis=1))


def _quaternion(frame: Floats) -> Quaternion:
    return rounded_turn(quaternion_of(frame))


def _axis(vector: Floats) -> Axis:
    x, y, z = vector.tolist()
    return x, y, z
