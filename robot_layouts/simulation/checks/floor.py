"""Which robots drive on a floor, and the floor to try them on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import takewhile

import numpy as np

from robot_layouts.simulation.scene.shapes import Plane
from robot_layouts.simulation.world import World
from robots import RobotDescriptor
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

FLOOR = "floor"  # its name in a world
UPWARD = (0.7071068, 0.0, -0.7071068, 0.0)  # a plane's normal, +x, turned to +z
LEVEL = 1e-3  # a slide rises by less per m; a turn's axis leans by less (sine)


def drives_on_floor(robot: RobotDescriptor) -> bool:
    """Tell whether a robot's first joints move all of it on a level floor, and turn it there.

    Raises:
        AssetError: If its URDF cannot be found.
    """
    urdf = robot.urdf.locate()
    model = read_model(read_urdf(urdf), urdf.as_posix())
    base = takewhile(lambda joint: _level(joint, model), _base_joints(model))
    return {joint.unit for joint in base} == {"m", "rad"}


def adds_floor(height: float) -> Callable[[World, int], None]:
    """Return what adds a floor to a world, at a height (m)."""
    plane = Plane(position=(0.0, 0.0, height), quaternion=UPWARD)

    def build(world: World, number: int) -> None:
        world.add(FLOOR, plane, kind="static")

    return build


def _base_joints(model: UrdfModel) -> Iterator[ModelJoint]:
    """Yield the joints that carry all that collides, from the root on."""
    link = model.root
    while not any(near in model.collisions for near in model.rigid_with(link)):
        joints = model.moving_on(link)
        if len(joints) != 1:
            return
        yield joints[0]
        link = joints[0].child


def _level(joint: ModelJoint, model: UrdfModel) -> bool:
    """Tell whether a joint leaves the robot on the floor, where the joints before it are at 0."""
    turn = np.eye(3)
    for before in model.path_to(joint.child):
        turn = turn @ before.origin[:3, :3]
    x, y, z = turn @ joint.axis
    return bool(abs(z) < LEVEL) if joint.unit == "m" else bool(np.hypot(x, y) < LEVEL)
