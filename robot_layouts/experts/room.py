"""What robots would be inside of in some posture: each other, themselves, bodies of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from weakref import WeakKeyDictionary

from objects.shapes import Plane
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.backend import Overlap
from robot_layouts.simulation.checks.overlaps import RobotsAlone
from robot_layouts.simulation.world import World, WorldBody
from tasks import TaskEnv

NOTHING: Mapping[str, Pose] = MappingProxyType({})


class Room:
    """The robots and bodies of a task, in a world of their own in which nothing moves.

    Attributes:
        movable: Names of the bodies that can be put elsewhere.
    """

    def __init__(self, task: TaskEnv, bodies: tuple[WorldBody, ...]) -> None:
        """Build it.

        Args:
            task: Says where robots stand.
            bodies: Of a scene; those that nothing touches do not count.
        """
        self._solid = tuple(body for body in bodies if any(s.collides for s in body.shapes))
        self.movable = [b.name for b in self._solid if not _stays(b)]
        build = partial(_add, bodies=self._solid)
        physics, simulator = task.scenario.physics, task.scenario.simulator
        self._alone = RobotsAlone(task.standing(), physics, build, simulator=simulator)
        self._robots = tuple(task.standing())

    def overlaps(
        self, scene: Scene, postures: Mapping[str, Floats], moved: Mapping[str, Pose] = NOTHING
    ) -> list[Overlap]:
        """Return what overlaps a robot, the deepest first.

        Args:
            scene: Says where the other robots and the bodies are.
            postures: All joints of some robots, each (dof,) (rad, m).
            moved: Poses of bodies that are elsewhere then.
        """
        everyone = {robot: scene.qpos(robot) for robot in self._robots} | dict(postures)
        poses = {name: scene.body(name) for name in self.movable} | dict(moved)
        found = self._alone.overlaps(everyone, poses, 0.0)
        return [each for each in found if each.one.robot or each.other.robot]


_rooms: WeakKeyDictionary[TaskEnv, tuple[tuple[WorldBody, ...], Room]] = WeakKeyDictionary()


def room_of(task: TaskEnv, scene: Scene) -> Room:
    """Return the room of a task with the bodies of a scene; the last one of each task is kept."""
    known = _rooms.get(task)
    if known is None or known[0] != scene.bodies:
        known = _rooms[task] = scene.bodies, Room(task, scene.bodies)
    return known[1]


def _stays(body: WorldBody) -> bool:
    return any(isinstance(shape, Plane) for shape in body.shapes)


def _add(world: World, number: int, bodies: tuple[WorldBody, ...]) -> None:
    for body in bodies:
        world.add(
            body.name,
            *body.shapes,
            kind="static" if _stays(body) else "kinematic",
            position=body.position,
            quaternion=body.quaternion,
        )
