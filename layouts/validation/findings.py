"""What a check of a layout found, as data and in words, and what to change, each in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from layouts.arrangement import Arrangement
from layouts.placement import Placement
from layouts.validation.collisions import Approach, Postures, nearer_than
from robot_layouts.kinematics.rotations import Floats
from robots.parts import PINCH

Point = tuple[float, ...]  # (3,) (m), world

LISTED_LINKS = 3  # pairs of links that a finding names in its text
NARROW = 0.02  # m; less clearance than this is worth a warning
FARTHEST_MOVE = 3.0  # m; of the search for a distance that is clear
MOVE_STEP = 0.01  # m
SIDEWAYS = np.array([0.0, 1.0, 0.0])  # where to move a robot that stands in another one


@dataclass(frozen=True)
class LinkPair:
    """Two links that overlap.

    Attributes:
        links: Their names; the second may be a table's.
        depth: By how much at worst (m).
        point: Where, in the world (m).
    """

    links: tuple[str, str]
    depth: float
    point: Point


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a layout, or nearly.

    Attributes:
        kind: ``collision``, ``self-collision``, ``table``, ``joint limit``, ``target``,
            ``clearance`` or ``files``.
        serious: Whether it makes the layout unusable; if not, it is a warning.
        robots: Names of the robots it is about.
        links: The links that overlap, the deepest first.
        amount: How much: depth of an overlap, excess over a limit, what is missing to a target,
            or the clearance that is left (``unit``).
        unit: ``m`` or ``rad``.
        what: What was found, in a sentence.
        advice: What to change, in a sentence.
        farther: How much farther apart the two robots have to stand (m); None if that does not
            help, or it is not about two robots.
    """

    kind: str
    serious: bool
    robots: tuple[str, ...]
    links: tuple[LinkPair, ...]
    amount: float
    unit: str
    what: str
    advice: str
    farther: float | None = None

    def __str__(self) -> str:
        """Return what was found and what to change, on two lines."""
        return f"{self.kind}: {self.what}\n  {self.advice}"


@dataclass(frozen=True)
class Clearance:
    """How near two robots come, or a robot and the table.

    Attributes:
        between: Names of both robots, or of a robot and a table.
        table: Whether the second is a table.
        links: The links that come nearest at the keyframes.
        distance: Between them at the keyframes (m); negative if they overlap.
        noisy_links: The links that come nearest with joint noise.
        noisy_distance: The smallest distance with joint noise (m).
        points: The nearest points at the keyframes, world (m).
    """

    between: tuple[str, str]
    table: bool
    links: tuple[str, str]
    distance: float
    noisy_links: tuple[str, str]
    noisy_distance: float
    points: tuple[Point, Point]


@dataclass(frozen=True)
class SharedWorkspace:
    """What two robots' tool centre points both get to, collisions aside.

    Attributes:
        robots: Names of both.
        volume: Of the shared space (m³).
        shares: The same, as a share of each one's own workspace.
    """

    robots: tuple[str, str]
    volume: float
    shares: tuple[float, float]


@dataclass(frozen=True)
class TargetReach:
    """Whether a robot reaches a target.

    Attributes:
        target: Name of the target.
        robot: Name of the robot.
        reached: Whether it does, without touching itself, the table or the others at their
            keyframes.
        missing: How far its tool centre point stays from the target (m).
        turn_missing: How far its orientation stays from the target's (rad); 0 if none was asked.
        obstacles: What it would touch there, where it would reach it but for that: names of
            robots, itself among them, and of tables.
        qpos: Joint positions that come nearest, in the descriptor's order (rad, m).
    """

    target: str
    robot: str
    reached: bool
    missing: float
    turn_missing: float
    obstacles: tuple[str, ...]
    qpos: tuple[float, ...]

    @property
    def blocked(self) -> bool:
        """Whether it would reach the target, were it not for a collision."""
        return bool(self.obstacles)


def length_text(metres: float) -> str:
    """Return a length as people write it: ``4.1 cm``, ``1.20 m``."""
    return f"{metres:.2f} m" if abs(metres) >= 1 else f"{metres * 100:.1f} cm"


def links_text(pairs: Sequence[LinkPair], between: tuple[str, str], *, table: bool = False) -> str:
    """Name pairs of links, the deepest first: ``left.panda_hand with right.panda_link7``."""
    one, other = between
    spoken = [
        f"{one}.{a} with {b if table else f'{other}.{b}'} ({length_text(pair.depth)})"
        for pair in pairs[:LISTED_LINKS]
        for a, b in [pair.links]
    ]
    rest = len(pairs) - len(spoken)
    return ", ".join(spoken) + (f" and {rest} more pairs of links" if rest else "")


def reach_text(reach: TargetReach) -> str:
    """Say whether a robot reaches a target, or what keeps it from that."""
    if reach.reached:
        return f"{reach.robot} reaches it"
    if reach.blocked:
        touched = ["itself" if name == reach.robot else name for name in reach.obstacles]
        return f"{reach.robot} would touch {' and '.join(touched)} there"
    turn = f" and {reach.turn_missing:.2f} rad" if reach.turn_missing >= 0.005 else ""
    return f"{reach.robot} stays {length_text(reach.missing)}{turn} away"


def to_stand_apart(layout: Arrangement, one: Postures, other: Postures) -> tuple[str, float | None]:
    """Say how far apart two robots are clear of each other, found by trying.

    Returns:
        The advice, and how much farther apart that is (m); None if none was found.
    """
    moves = [
        (move, now, direction)
        for direction, way, now in _ways(layout, one.name, other.name)
        if (move := _clear_move(one, other, way)) is not None
    ]
    if not moves:
        return f"even {FARTHEST_MOVE:g} m farther apart they collide; use another keyframe", None
    move, now, direction = min(moves)
    return (
        f"stand {one.name} and {other.name} {move:.3f} m farther apart{direction}"
        f" ({now + move:.3f} m between their bases instead of {now:.3f} m), which leaves"
        f" {length_text(NARROW)} or more",
        move,
    )


def to_start_elsewhere(placement: Placement) -> str:
    """Say which keyframes there are to start from besides the placement's own."""
    robot, start = placement.robot, placement.start_keyframe
    if start is None:
        return "start from other joint positions than qpos"
    others = [name for name in robot.keyframes if name not in (start, PINCH)]
    if not others:
        return f"give {robot.name} a keyframe besides {start!r}, its only one"
    return f"start from another keyframe than {start!r}: {', '.join(others)}"


def to_touch_itself_no_more(placement: Placement, overlaps: Sequence[Approach]) -> str:
    """Say how a robot keeps clear of itself, perhaps with less joint noise."""
    if any(overlap.posture == 0 for overlap in overlaps):
        return to_start_elsewhere(placement)
    noise = f"less joint noise than qpos_noise={placement.qpos_noise:g} rad"
    return f"{to_start_elsewhere(placement)}; or {noise}"


def to_leave_the_table(name: str, placement: Placement, sunk: float) -> str:
    """Say how far to raise a robot that sinks into a table so far (m)."""
    lift = sunk + MOVE_STEP
    return f"raise the base of {name} by {lift:.3f} m, or {to_start_elsewhere(placement)}"


def to_be_reached(target: str, reach: TargetReach, *, otherwise_turned: bool) -> str:
    """Say how a target comes into a robot's reach.

    Args:
        target: Its name.
        reach: The robot that comes nearest.
        otherwise_turned: Whether it reaches the place in another orientation.
    """
    if reach.obstacles:
        return f"move {target} away from {_obstacles(reach)}, or give {reach.robot} more room"
    if otherwise_turned:
        return f"choose another orientation of {target}; its place is in reach of {reach.robot}"
    return f"move {reach.robot} or {target} by as much towards each other"


def _obstacles(reach: TargetReach) -> str:
    own_base = f"the base of {reach.robot}"
    return " and ".join(own_base if o == reach.robot else o for o in reach.obstacles)


def _ways(layout: Arrangement, one: str, other: str) -> Iterator[tuple[str, Floats, float]]:
    """Yield in words and as a unit vector where to move, and how far that way they are (m)."""
    between = np.array(layout[other].base_position) - layout[one].base_position
    level, height = float(np.hypot(*between[:2])), abs(float(between[2]))
    one_above_the_other = height > MOVE_STEP
    yield (
        " horizontally" if one_above_the_other else "",
        between * (1, 1, 0) / level if level > 1e-6 else SIDEWAYS,
        level,
    )
    if one_above_the_other:
        yield " vertically", between * (0, 0, 1) / height, height


def _clear_move(one: Postures, other: Postures, way: Floats) -> float | None:
    """Return by how much ``other`` has to move along ``way`` (m), rounded up, or None."""
    steps = round(FARTHEST_MOVE / MOVE_STEP)
    low, high = 0, 1
    while nearer_than(one, other.moved(high * MOVE_STEP * way), NARROW):
        low, high = high, high * 2
        if high > steps:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        near = nearer_than(one, other.moved(middle * MOVE_STEP * way), NARROW)
        low, high = (middle, high) if near else (low, middle)
    return high * MOVE_STEP
