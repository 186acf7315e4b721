"""Which things of a world the names of a randomization mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from robots import UnknownNameError
from simulation import Simulation
from simulation.parts import Part

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
    return {**found, **_links(simulation)}


def _links(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
    links = {
        robot: tuple(Part(robot, link) for link in simulation.index.robots[robot].links)
        for robot in simulation.layout
    }
    single = {str(part): (part,) for parts in links.values() for part in parts}
    return {**links, **single}
