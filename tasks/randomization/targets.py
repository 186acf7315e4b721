"""Which things of a world the names of a randomization mean."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from layouts import Layout
from objects.shapes import SIZED
from robot_layouts.simulation import Camera, Simulation
from robot_layouts.simulation.cameras import AnyCamera, RobotCamera, camera_name
from robot_layouts.simulation.variation import LIGHTS
from robot_layouts.simulation.world import Part, WorldBody
from robots import UnknownNameError

Thing = TypeVar("Thing")


class RandomizedThings(NamedTuple):
    """What is drawn for a thing, or for several alike.

    Attributes:
        takes: What it is drawn from.
        means: The things.
    """

    takes: Any
    means: tuple[Any, ...]


def targets(
    axis: str, declared: Mapping[str, Any], offered: Mapping[str, tuple[Thing, ...]]
) -> dict[str, RandomizedThings]:
    """Return what is meant by each name of an axis, the more important ones last.

    Args:
        axis: The axis, for messages.
        declared: What is drawn, by name; ``*`` stands for any letters but the dot after a robot.
        offered: The things that there are, by name.

    Raises:
        UnknownNameError: If a name means nothing.
    """
    found: dict[str, RandomizedThings] = {}
    for pattern, takes in declared.items():
        names = matching(pattern, offered)
        if not names:
            raise UnknownNameError(f"target of {axis}", pattern, offered)
        for name in names:
            found.pop(name, None)
            found[name] = RandomizedThings(takes, offered[name])
    return found


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """Return the names that a pattern means: those with as many dots."""
    if "*" not in pattern:
        return [name for name in names if name == pattern]
    dots = pattern.count(".")
    return [name for name in names if name.count(".") == dots and fnmatchcase(name, pattern)]


def offers(
    cameras: Sequence[Camera], painted: Container[str]
) -> dict[str, Callable[[Simulation], dict[str, tuple[Any, ...]]]]:
    """Return, for each axis that takes names, what returns the things that there are, by name.

    Args:
        cameras: The task's own cameras.
        painted: Names of bodies whose colour is drawn with something else.
    """
    return {
        "mass": lambda simulation: _parts(simulation, lambda body: body.kind == "dynamic"),
        "friction": lambda simulation: _parts(
            simulation, lambda body: any(shape.collides for shape in body.shapes)
        ),
        "size": _sized_bodies,
        "stiffness": _driven_joints,
        "damping": _driven_joints,
        "joint_friction": _driven_joints,
        "bases": lambda simulation: _by_name(simulation.layout),
        "action_noise": _action_numbers,
        "cameras": lambda simulation: _cameras(simulation.layout, cameras),
        "lights": lambda simulation: _by_name(LIGHTS),
        "colors": lambda simulation: _parts(simulation, lambda body: body.name not in painted),
        "textures": lambda simulation: _by_name(simulation.worlds[0].bodies),
    }


def _by_name(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    return {name: (name,) for name in names}


def _parts(simulation: Simulation, fit: Callable[[WorldBody], bool]) -> dict[str, tuple[Part, ...]]:
    """Return some bodies, the links of each robot, and each of these by itself."""
    bodies = [body.name for body in simulation.worlds[0].bodies.values() if fit(body)]
    links = {
        robot: tuple(Part(robot, link) for link in simulation.index.robots[robot].links)
        for robot in simulation.layout
    }
    single = {str(part): (part,) for parts in links.values() for part in parts}
    return {**{name: (Part(None, name),) for name in bodies}, **links, **single}


def _sized_bodies(simulation: Simulation) -> dict[str, tuple[str, ...]]:
    """Return the bodies that have a size of their own, and that no reset puts back as furniture."""
    return _by_name(
        body.name
        for body in simulation.worlds[0].bodies.values()
        if not (body.anchored or body.part_of)
        and all(isinstance(shape, SIZED) for shape in body.shapes)
    )


def _driven_joints(simulation: Simulation) -> dict[str, tuple[Part, ...]]:
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


def _action_numbers(simulation: Simulation) -> dict[str, tuple[int, ...]]:
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


def _cameras(layout: Layout, cameras: Sequence[Camera]) -> dict[str, tuple[str, ...]]:
    """Return the names of the cameras that observe: a task's own, and those of its robots."""
    every: list[AnyCamera] = [*cameras]
    every += [RobotCamera(n, m) for n, place in layout.items() for m in place.robot.cameras]
    return _by_name(map(camera_name, every))
