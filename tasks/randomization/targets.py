"""Which things of a world the names of a randomization mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from robot_layouts.simulation import Simulation
from robot_layouts.simulation.scene.parts import Part
from robot_layouts.simulation.scene.shapes import SIZED
from robots import UnknownNameError

Thing = TypeVar("Thing")


class Target(NamedTuple):
    """What is drawn for a thing, or for several alike.

    Attributes:
        takes: What it is drawn from.
        means: The things.
    """

    takes: Any
    means: tuple[Any, ...]


def targets(
    axis: str, declared: Mapping[str, Any], offered: Mapping[str, tuple[Thing, ...]]
) -> dict[str, Target]:
    """Return what is meant by each name of an axis, the more important ones last.

    Args:
        axis: The axis, for messages.
        declared: What is drawn, by name; ``*`` stands for any letters but the dot after a robot.
        offered: The things that there are, by name.

    Raises:
        UnknownNameError: If a name means nothing.
    """
    found: dict[str, Target] = {}
    for pattern, takes in declared.items():
        names = matching(pattern, offered)
        if not names:
            raise UnknownNameError(f"target of {axis}", pattern, offered)
        for name in names:
            found.pop(name, None)
            found[name] = Target(takes, offered[name])
    return found


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """Return the names that a pattern means: those with as many dots."""
    if "*" not in pattern:
        return [name for name in names if name == pattern]
    dots = pattern.count(".")
    return [name for name in names if name.count(".") == dots and fnmatchcase(name, pattern)]


def heavy_parts(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
    """Return what has a mass: dynamic bodies, robots, and each of their links."""
    bodies = simulation.worlds[0].bodies.values()
    found = {body.name: (Part(None, body.name),) for body in bodies if body.kind == "dynamic"}
    return {**found, **linked_parts(simulation)}


def linked_parts(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
    """Return the links of each robot, and each of them by itself."""
    links = {
        robot: tuple(Part(robot, link) for link in simulation.index.robots[robot].links)
        for robot in simulation.layout
    }
    single = {str(part): (part,) for parts in links.values() for part in parts}
    return {**links, **single}


def rough_parts(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
    """Return what has a friction: bodies that touch others, robots, and each of their links."""
    bodies = simulation.worlds[0].bodies.values()
    touching = [body.name for body in bodies if any(shape.collides for shape in body.shapes)]
    return {**{name: (Part(None, name),) for name in touching}, **linked_parts(simulation)}


def sized_bodies(simulation: Simulation) -> dict[str, tuple[str, ...]]:
    """Return the bodies that have a size, and are no furniture that every reset puts back."""
    return {
        body.name: (body.name,)
        for body in simulation.worlds[0].bodies.values()
        if not body.anchored and all(isinstance(shape, SIZED) for shape in body.shapes)
    }


def driven_joints(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
    """Return what has drives: robots, their joint groups, and joints."""
    joints: dict[str, tuple[Part, ...]] = {}
    for robot, placement in simulation.layout.items():
        groups = placement.robot.action_split.groups
        joints[robot] = tuple(Part(robot, joint) for joint in placement.robot.joints)
        for joint in joints[robot]:
            joints[str(joint)] = (joint,)
        for name, group in groups.items():
            joints[f"{robot}.{name}"] = tuple(Part(robot, joint) for joint in group.joints)
    return joints


def standing_robots(simulation: Simulation) -> dict[str, tuple[str, ...]]:
    """Return the robots."""
    return {robot: (robot,) for robot in simulation.layout}


def action_numbers(simulation: Simulation) -> dict[str, tuple[int, ...]]:
    """Return the action numbers of robots and of their joint groups."""
    numbers: dict[str, tuple[int, ...]] = {}
    first = 0
    for robot, placement in simulation.layout.items():
        begin = first
        for name, group in placement.robot.action_split.groups.items():
            numbers[f"{robot}.{name}"] = tuple(range(first, first + group.size))
            first += group.size
        numbers[robot] = tuple(range(begin, first))
    return {name: own for name, own in numbers.items() if own}
