"""Other robots at a task's places, where they reach what the task's own robots do."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import lt
from typing import TYPE_CHECKING, Any

from layouts.distances import SHOULDER, is_known_arm
from layouts.frames import Rectangle
from layouts.layout import Layout
from layouts.placement import Placement, RobotLike, faced, load_robot, load_robots
from robot_layouts.core.quoting import shown
from robot_layouts.kinematics.quaternions import forward, inverted, rotated, yaw_quaternion
from robots import (
    AssetError,
    LayoutError,
    MissingPackageError,
    RobotDescriptor,
    UnknownNameError,
)

if TYPE_CHECKING:
    from layouts.validation.findings import Finding

# Shares of a reach at which what is worked on lies ahead. A Panda of ManiSkill stands 0.615 m, or
# 0.72 of its reach, behind the middle of its table; two arms of one body reach over all of it.
ALONE, BODY = 0.72, 0.6
FARTHEST = 1.5  # times as far from the middle, where robots would collide as they start
NOISES = 20  # draws of joint noise in which they are not to
Point = tuple[float, float]

NAME = "robot"  # of the place of one robot that serves all roles


def at_task(
    robots: RobotLike | Mapping[str, RobotLike],
    task: Layout | Any,
    *,
    holding: Collection[str] | None = None,
    needed: Mapping[str, float] | None = None,
) -> Layout:
    """Return a task's layout with other robots, each where it reaches what the task's own does.

    A robot stands on the line from the task's own to the middle of what is worked on, turned
    towards it and at the same height: as much nearer as it reaches less than that one of the task's
    own which reaches least, and farther only as far as all robots reach farther. What a robot
    holds it has to reach with its gripper down. It is raised, if its wheels or feet are lower than
    its base, and stands before the task's table, if its shoulder is too high to work on it. Robots
    that would collide as they start begin with their hands drawn back, and stand
    farther from the middle if that is not enough, where their files are at hand.

    One robot of several limbs serves several places at once: its limbs are called like them, the
    left one serving the first unless they are called so already, and its shoulders are above the
    places. Where its files are at hand, all of it but its limbs is behind the task's table, and its
    hands wait over what they share, grippers down (`Placement.qpos`).

    Nothing else is checked; `Layout.validate` and `tasks.make` do so.

    Args:
        robots: Robot by place, for some or all of them; or one robot for all.
        task: The task, its class, or a layout with its places.
        holding: Places whose robots hold things; None for those that the task says need a gripper
            which opens so wide.
        needed: How far arms have to reach where the task's own stand, by place (m); None for what
            the task says.

    Raises:
        LayoutError: If the task has no layout, or more places than the robot has limbs.
        UnknownNameError: If there is no such place or robot.

    Example:
        >>> import layouts, tasks
        >>> two = tasks.get_task_class("TwoRobotPickCube-v1")
        >>> list(layouts.at_task("baxter", two).arms)
        ['robot.left', 'robot.right']
    """
    layout = task if isinstance(task, Layout) else getattr(task, "layout", None)
    if not isinstance(layout, Layout):
        raise LayoutError(f"task is {shown(task)}; a task, its class or a Layout is needed")
    table = getattr(task, "table", None)
    outline = table.outline(layout) if table is not None else None
    if not isinstance(robots, Mapping):
        robot = load_robot(robots)
        if robot.limbs:
            return Layout({NAME: _body(robot, layout, outline)}, layout.frames)
        robots = dict.fromkeys(layout, robot)
    from layouts.shared_place import working_factors

    loaded = load_robots(robots)
    for place in loaded:
        if place not in layout:
            raise UnknownNameError("robot of this layout", place, layout)
    middle = _middle(layout)
    holding = held_widths(task, layout) if holding is None else holding
    needed = needed_reaches(task, layout) if needed is None else needed
    places = {place: _starting(at, loaded.get(place, at.robot)) for place, at in layout.items()}
    after = Layout(places, layout.frames)
    _, factors = working_factors(after, layout, [*layout], holding, needed)
    _, by_reach = working_factors(after, layout, [*layout], (), needed)

    def placed(share: float) -> Layout:
        moved = dict(layout)
        for place, factor in zip(layout, factors, strict=True):
            robot = after[place].robot
            others = 1.0 if robot == layout[place].robot else share
            moved[place] = _moved(layout, place, robot, middle, factor * others)
        return Layout(moved, layout.frames)

    holds = any(map(lt, factors, by_reach))  # then they stand nearer to each other than is usual
    drawn = [place for place in loaded if place in holding] if holds else [*loaded]
    arms = [place for place in drawn if not loaded[place].limbs]
    return _apart(placed, arms, middle, outline)


def _apart(
    placed: Callable[[float], Layout], arms: Sequence[str], middle: Point, table: Rectangle | None
) -> Layout:
    """Return a layout whose robots do not collide as they start; the nearest one if none is found.

    Args:
        placed: Makes one, with robots farther from the middle by a factor.
        arms: Those that are drawn back before all stand farther apart.
        middle: Of what they work on, x and y (m).
        table: Outline of the task's own table, which they are not to touch either.
    """
    from layouts.ready import before_robots, drawn_back

    share, back = 1.0, False
    with suppress(AssetError, MissingPackageError):  # else their bodies are not known here
        while share < FARTHEST:
            layout = placed(share)
            if back:
                ready = {place: drawn_back(layout[place], middle) for place in arms}
                layout = Layout({**layout, **ready}, layout.frames)
            cut = before_robots(table, layout) if table is not None else None
            report = layout.validate(workspaces=False, samples=NOISES, table=cut)
            found = [each for each in report.findings if each.kind in ("collision", "table")]
            if not found:
                return layout
            share *= max(_factor(layout, finding) for finding in found) if back else 1.0
            back = True
    return placed(1.0)


def _factor(layout: Layout, finding: Finding) -> float:
    """Return by which factor two robots have to stand farther apart so that they do not collide.

    It is more than any where that does not help: one robot touches itself, or the table.
    """
    if len(finding.robots) == 1:
        return FARTHEST
    (x, y, _), (u, v, _) = (layout[robot].base_position for robot in finding.robots)
    apart = math.hypot(x - u, y - v)
    return FARTHEST if finding.farther is None or not apart else 1 + finding.farther / apart


def held_widths(task: Layout | Any, places: Iterable[str]) -> dict[str, float]:
    """Return how wide the things are that a task's robots hold, by place (m); none of a layout.

    Args:
        task: The task, or its class, whose ``needs`` say how wide grippers must open.
        places: Its places.
    """
    return _needed(task, places, "opening")


def needed_reaches(task: Layout | Any, places: Iterable[str]) -> dict[str, float]:
    """Return how far a task's robots must reach, by place (m), where its ``needs`` say so."""
    return _needed(task, places, "reach")


def _needed(task: Layout | Any, places: Iterable[str], what: str) -> dict[str, float]:
    """Return a length that a task's places need, by place (m), where they need it."""
    needs = getattr(task, "needs", {})
    found = {place: getattr(needs.get(place, needs.get("*")), what, None) for place in places}
    return {place: length for place, length in found.items() if length}


def _with(placement: Placement, robot: RobotDescriptor) -> Placement:
    """Return a placement with another robot, at home where it lacks the keyframe."""
    if placement.keyframe not in robot.keyframes:
        placement = replace(placement, keyframe=None)
    return placement.with_robot(robot)


def _starting(placement: Placement, robot: RobotDescriptor) -> Placement:
    """Return a placement with another robot, its torso as low as it is to start."""
    placement = _with(placement, robot)
    if not is_known_arm(robot):
        from layouts.ready import stooped

        with suppress(AssetError, MissingPackageError):  # else its bodies are not known here
            return stooped(placement)
    return placement


def _moved(
    layout: Layout, place: str, robot: RobotDescriptor, middle: Point, factor: float
) -> Placement:
    """Return a placement with another robot, as much farther from the middle as a factor says."""
    placement = layout[place]
    if robot == placement.robot and factor == 1.0:
        return placement
    moved = _with(placement, robot)
    *flat, z = placement.base_position
    if placement.on is None:
        x, y = (round(m + (at - m) * factor, 4) for m, at in zip(middle, flat, strict=True))
        turned = faced(robot, placement.facing)
        moved = replace(moved, position=(x, y, z), quaternion=turned, rpy=None)
    elif _table_of(layout, placement) and factor != 1.0:
        (x, y), turned = flat, inverted(layout.frame_poses[placement.on].quaternion)
        way = rotated(turned, ((x - middle[0]) * (factor - 1), (y - middle[1]) * (factor - 1), 0.0))
        along = zip(placement.local_pose.position, way, strict=True)
        a, b, c = (round(at + further, 4) for at, further in along)
        moved = replace(moved, position=(a, b, c))
    if not is_known_arm(robot):
        from layouts.ready import grounded

        with suppress(AssetError, MissingPackageError):  # else its bodies are not known here
            return grounded(moved)
    return moved


def _body(robot: RobotDescriptor, layout: Layout, table: Rectangle | None) -> Placement:
    """Return where a robot stands whose limbs serve all places, and how it starts."""
    from layouts.ready import made_ready, off_the_table
    from layouts.shared_place import shared_place

    roles = _roles(robot, list(layout))
    limb, role = robot.limbs[next(iter(roles.values()))], next(iter(roles))
    middle, own = _middle(layout), layout[role]
    across, along = (at - m for at, m in zip(own.base_position[:2], middle, strict=True))
    if len(layout) == 1:  # then it stands behind the middle, as the task's own does
        across, along = along, -across
    yaw = math.atan2(-across, along)  # of what has that direction to its left
    ahead, (x, y, height) = BODY * limb.reach, limb.base
    back = x + math.sqrt(max(ahead**2 - y**2, 0.0))
    at_x, at_y = middle[0] - back * math.cos(yaw), middle[1] - back * math.sin(yaw)
    raised = own.base_position[2] + SHOULDER * limb.reach - height
    place = (round(at_x, 4), round(at_y, 4), round(raised, 4))
    owners = {name: tuple(part.action_split.groups) for name, part in robot.parts.items()}
    limbs = {role: replace(robot.limbs[name], groups=owners[name]) for role, name in roles.items()}
    others = {name: part for name, part in robot.limbs.items() if name not in roles.values()}
    serving = robot if list(roles) == list(roles.values()) else replace(robot, limbs=limbs | others)
    placement = Placement(serving, place, faced(robot, yaw_quaternion(yaw)))
    try:
        placement = off_the_table(placement, (math.cos(yaw), math.sin(yaw)), table)
        arms = [f"{NAME}.{role}" for role in roles]
        shared = shared_place(Layout({NAME: placement}), arms, table)
        return made_ready(placement, list(roles), shared[0], table) if shared else placement
    except (AssetError, MissingPackageError):  # its bodies are not known here
        return placement


def _roles(robot: RobotDescriptor, places: Sequence[str]) -> dict[str, str]:
    """Return the limb that serves each place, the left one's first."""
    from_left = sorted(robot.limbs, key=lambda name: -robot.limbs[name].base[1])
    if len(places) > len(from_left):
        raise LayoutError(
            f"{robot.name} has {len(from_left)} limbs ({', '.join(from_left)}), and the task"
            f" {len(places)} places ({', '.join(places)})"
        )
    if set(places) <= set(from_left):
        return {name: name for name in from_left if name in places}
    return dict(zip(places, from_left, strict=False))


def _table_of(layout: Layout, placement: Placement) -> str:
    """Return the table at an edge of which a robot stands; empty if it stands at none."""
    table, edge, _ = (placement.on or "").rpartition(".")
    return table if edge and placement.on in layout.frames and table in layout.frames else ""


def _middle(layout: Layout) -> Point:
    """Return the middle of what the robots of a task's layout work on, x and y (m)."""
    tables = {_table_of(layout, placement) for placement in layout.values()}
    if len(tables) == 1 and (table := tables.pop()):
        return layout.frame_poses[table].position[:2]
    x, y = (
        sum(along) / len(layout)
        for along in zip(
            *(placement.base_position[:2] for placement in layout.values()), strict=True
        )
    )
    if len(layout) > 1:
        return x, y
    (placement,) = layout.values()
    ahead_x, ahead_y, _ = forward(placement.facing)
    far = ALONE * placement.robot.reach / max(math.hypot(ahead_x, ahead_y), 1e-9)
    return x + far * ahead_x, y + far * ahead_y
