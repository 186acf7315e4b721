"""What to change about what is wrong with a layout, each in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from layouts.arrangement import Arrangement
from layouts.placement import Placement
from layouts.validation.collisions import Approach, Postures, nearer_than
from layouts.validation.findings import TargetReach, length_text
from robot_layouts.kinematics.rotations import Floats

NARROW = 0.02  # m; less clearance than this is worth a warning
FARTHEST_MOVE = 3.0  # m; of the search for a distance that is clear
MOVE_STEP = 0.01  # m
SIDEWAYS = np.array([0.0, 1.0, 0.0])  # where to move a robot that stands in another one


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
    others = [name for name in robot.keyframes if name != start]
    if not others:
        return f"give {robot.name} a keyframe besides {start!r}, its only one"
    return f"start from another keyframe than {start!r}: {', '.join(others)}"


def to_touch_itself_no_more(placement: Placement, overlaps: Sequence[Approach]) -> str:
    """Say how a robot keeps clear of itself, perhaps with less joint noise."""
    if any(overlap.posture == 0 for overlap in overlaps):
        return to_start_elsewhere(placement)
    noise = f"less joint noise than qpos_noise={placement.qpos_noise:g} rad"
    return f"{to_start_elsewhere(placement)}; or {noise}"


def to_leave_the_table(name: str, placement: Placement, deepest: Approach) -> str:
    """Say how far to raise a robot that sinks into a table."""
    lift = MOVE_STEP - deepest.distance
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
