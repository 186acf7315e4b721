"""Distances that presets choose, from how far their robots reach.

Neighbours stand `HAND_OVER` of the sum of their reaches apart: the last eighth of that sum is where
both can work, so one can hand an object to the other. They never stand so near that one can reach
the other's base; where one reaches less than half as far as the other, hardly farther than that, as
the reach of a tall robot shrinks towards the height at which a small one works. Arms of the
catalogue, however mixed, keep clear of each other so. Where there are others, presets also look at
their bodies, and stand all robots so much farther apart (``more``) that none collide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise

from robots import RobotDescriptor, RobotRegistry
from robots.registry import CATALOGUE as ROBOTS

# Share of the sum of two reaches. ManiSkill's two-robot tasks stand their Pandas 1.5 m apart,
# which is 0.877 of twice 0.855 m (mani_skill 3.0.1, scene_builder/table).
HAND_OVER = 7 / 8
# The same where robots also stand round a corner of a table: at 7/8 their hands would meet over its
# middle. Pandas need 0.93 to start 5 cm apart there, with joint noise.
ROUND_CORNERS = 15 / 16
UNEQUAL = 1 / 2  # of the larger reach; what counts as much less
SHOULDER = 0.4  # of an arm's reach; how high its first joint is above the ground that it works on
ARM = 0.3  # m; what reaches less is a hand
OPPOSITE = (("north", "south"), ("east", "west"))  # edges of a table

Rows = Mapping[str, Sequence[RobotDescriptor]]  # the robots of each edge of a table, in order


def is_known_arm(robot: RobotDescriptor) -> bool:
    """Return whether a robot is an arm of the catalogue that stands on its base.

    Hands are as wide as they reach, and wheels may be lower than the base that they carry.
    """
    return in_catalogue(robot) and robot.reach >= ARM and not robot.no_floor_contact


def in_catalogue(robot: RobotDescriptor) -> bool:
    """Return whether a robot is as the catalogue has it."""
    return robot.name in ROBOTS and RobotRegistry.load(robot.name) == robot


def apart(one: RobotDescriptor, other: RobotDescriptor) -> float:
    """Return the hand-over distance (m) of two bases, from which neither reaches the other one."""
    smaller, larger = sorted((one.reach, other.reach))
    return larger if smaller < UNEQUAL * larger else max(HAND_OVER * (smaller + larger), larger)


def farther(reaches: Sequence[float], needed: Sequence[float]) -> list[float]:
    """Return by which factors robots stand farther from what they do than those they stand in for.

    One that reaches less than is needed stands nearer; none stands farther than as all of them
    reach farther.

    Args:
        reaches: How far the robots reach (m).
        needed: How far they would have to where those stand (m).
    """
    factors = [reach / need for reach, need in zip(reaches, needed, strict=True)]
    most = max(1.0, min(factors))
    return [min(factor, most) for factor in factors]


def gaps(row: Iterable[RobotDescriptor], more: float = 0.0) -> list[float]:
    """Return the hand-over distances of neighbours in a row, and as much more each (m)."""
    return [apart(*pair) + more for pair in pairwise(row)]


def centred(gaps: Sequence[float]) -> list[float]:
    """Return the places of a row with these gaps, from smallest to largest, about 0 (m)."""
    return list(accumulate(gaps, initial=-sum(gaps) / 2))


def ring_of(robots: Sequence[RobotDescriptor], more: float) -> tuple[float, list[float]]:
    """Return the radius (m) and the angles (rad) that put neighbours at hand-over distance.

    Or as much more (m) farther apart.

    The neighbours' distances are the sides of a polygon whose corners lie on the circle.
    """
    count = len(robots)
    if count == 1:
        return HAND_OVER * robots[0].reach, [0.0]
    sides = gaps([*robots, robots[0]], more)
    longest = max(range(count), key=lambda i: sides[i])
    if sides[longest] - min(sides) < 1e-12:
        radius = sides[0] / (2 * math.sin(math.pi / count))
        return radius, [2 * math.pi * i / count for i in range(count)]
    radius = _circumradius(sides)
    arcs = [2 * math.asin(min(side / (2 * radius), 1.0)) for side in sides]
    arcs[longest] = 2 * math.pi - (sum(arcs) - arcs[longest])
    return radius, list(accumulate(arcs[:-1], initial=0.0))


def share_at_table(rows: Rows) -> float:
    """Return at which share of its reach a robot at an edge is from the middle of a table."""
    along_x, along_y = (any(rows[edge] for edge in pair) for pair in OPPOSITE)
    return ROUND_CORNERS if along_x and along_y else HAND_OVER


def table_for(rows: Rows, inset: float, more: float) -> tuple[float, float]:
    """Return width and depth (m) of a table with robots at its edges.

    One robot at an edge works in the middle. Of several, the outer ones stand as far from the
    corner as any robot round it reaches.

    Args:
        rows: The robots of each edge.
        inset: Of their bases from the edge (m).
        more: How much farther apart they stand than by their reach (m).
    """
    farthest = max(robot.reach for row in rows.values() for robot in row)
    alone = share_at_table(rows) * farthest

    def length(edge: str) -> float:
        span = sum(gaps(rows[edge], more))
        return span + 2 * (farthest if span > 0 else alone)

    width, depth = (max(map(length, pair)) + 2 * inset + more for pair in OPPOSITE)
    return width, depth


def _circumradius(sides: Sequence[float]) -> float:
    """Return the radius of the circle through the corners of a polygon with these sides (m).

    Each side is shorter than the others together. Found by bisection: the smallest circle that
    the longest side fits into is half of it.
    """
    longest = max(sides)

    def angle(radius: float) -> float:  # half of what all sides but the longest span
        return sum(math.asin(min(s / (2 * radius), 1.0)) for s in sides) - math.asin(
            min(longest / (2 * radius), 1.0)
        )

    # The longest side spans the rest of the circle; more than half of it if the others span less.
    centre_inside = angle(longest / 2) >= math.pi / 2

    def too_small(radius: float) -> bool:
        rest = math.asin(longest / (2 * radius))
        return angle(radius) > math.pi - rest if centre_inside else angle(radius) < rest

    low, high = longest / 2, longest
    while too_small(high):
        low, high = high, 2 * high
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if too_small(middle) else (low, middle)
    return high
