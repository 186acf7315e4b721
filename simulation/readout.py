"""Where each frame and joint of a world stands in a read-out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from robots import Fingers, UnknownNameError
from simulation.world import World

Place = TypeVar("Place")


class ReadoutIndex:
    """Places of bodies, links, tool centre points and joints, the same in a batch's every world.

    A frame is anything with a pose: SAPIEN's entities in their own order, then the tool centre
    points that lie between links.

    Attributes:
        entities: Number of entities.
        frames: Number of frames.
        dof: Number of joints of all robots.
        bodies: Frame of each body.
        joint_slices: Joints of each robot, in layout order.
        mean_frames: For each frame that lies between links: itself, the frame that orients it,
            and the frames whose mean is its origin.
        pairs: Pairs of frames whose distance was asked for.
    """

    def __init__(self, world: World) -> None:
        """Index one world."""
        place = {entity: i for i, entity in enumerate(world.scene.entities)}
        self.entities = self.frames = len(place)
        self.bodies = {name: place[body.entity] for name, body in world.bodies.items()}
        self._links = {
            name: {link: place[component.entity] for link, component in robot.links.items()}
            for name, robot in world.robots.items()
        }
        self.dof = 0
        self._joints: dict[str, slice] = {}
        self._arm_joints: dict[str, slice | list[int]] = {}
        self._grippers: dict[str, tuple[list[int], np.float32]] = {}
        self._bases: dict[str, int] = {}
        self._tcps: dict[str, int] = {}
        self._fingers = {name: robot.descriptor.fingers for name, robot in world.robots.items()}
        self.mean_frames: list[tuple[int, int, list[int]]] = []
        for name, robot in world.robots.items():
            descriptor = robot.descriptor
            driven = zip(descriptor.joints, robot.active_index, strict=True)
            self._arm_joints[name] = _as_slice(
                sorted(self.dof + i for joint, i in driven if joint in descriptor.arm_joints)
            )
            self._grippers[name] = self._gripper(name, world)
            self._bases[name] = place[robot.articulation.links[0].entity]
            self._joints[name] = slice(self.dof, self.dof + len(robot.joints))
            self.dof += len(robot.joints)
            self._tcps[name] = self._tcp_frame(name, world)
        self.joint_slices = tuple(self._joints.values())
        self.pairs = FramePairs()

    def body(self, name: str) -> int:
        """Return the frame of a body."""
        return _look_up("body of this world", name, self.bodies)

    def link(self, robot: str, link: str) -> int:
        """Return the frame of a link."""
        return _look_up(f"link of {robot}", link, _look_up(_ROBOT, robot, self._links))

    def tcp(self, robot: str) -> int:
        """Return the frame of a robot's tool centre point."""
        return _look_up(_ROBOT, robot, self._tcps)

    def base(self, robot: str) -> int:
        """Return the frame of a robot's root link."""
        return _look_up(_ROBOT, robot, self._bases)

    def fingers(self, robot: str) -> Fingers | None:
        """Return the links with which a robot grasps."""
        return _look_up(_ROBOT, robot, self._fingers)

    def joints(self, robot: str) -> slice:
        """Return the places of a robot's joints."""
        return _look_up(_ROBOT, robot, self._joints)

    def arm_joints(self, robot: str) -> slice | list[int]:
        """Return the places of a robot's joints that are not its gripper's."""
        return _look_up(_ROBOT, robot, self._arm_joints)

    def gripper(self, robot: str) -> tuple[list[int], np.float32]:
        """Return the places of a robot's gripper joints and the sum of their upper limits (m)."""
        return _look_up(_ROBOT, robot, self._grippers)

    def _gripper(self, name: str, world: World) -> tuple[list[int], np.float32]:
        robot = world.robots[name]
        joints = {
            self.dof + i: joint.limits[0, 1]
            for i, joint in enumerate(robot.joints)
            if joint.name not in robot.descriptor.arm_joints
        }
        return list(joints), np.float32(sum(joints.values()))

    def _tcp_frame(self, name: str, world: World) -> int:
        descriptor = world.robots[name].descriptor
        orientation = self.link(name, descriptor.tcp_link)
        if not descriptor.tcp_position_links:
            return orientation
        points = [self.link(name, link) for link in descriptor.tcp_position_links]
        self.mean_frames.append((self.frames, orientation, points))
        self.frames += 1
        return self.frames - 1


class FramePairs:
    """Pairs of frames that somebody asks the distance of, so that all are computed in one go.

    A task asks for the same distances after every step: from the second step on they are one
    subtraction and one norm over all pairs.

    Attributes:
        columns: First and second frame of every pair, each (K,).
    """

    def __init__(self) -> None:
        """Start without pairs."""
        self._places: dict[tuple[int, int], int] = {}
        self.columns = np.empty((2, 0), np.intp)

    def place(self, start: int, end: int) -> int:
        """Return the number of a pair, adding it if it is new."""
        found = self._places.get((start, end))
        if found is None:
            found = self._places[start, end] = len(self._places)
            self.columns = np.array(list(self._places), np.intp).T
        return found


_ROBOT = "robot of this layout"


def _look_up(kind: str, name: str, places: Mapping[str, Place]) -> Place:
    try:
        return places[name]
    except KeyError:
        raise UnknownNameError(kind, name, places) from None


def _as_slice(indices: list[int]) -> slice | list[int]:
    contiguous = indices == list(range(indices[0], indices[0] + len(indices)))
    return slice(indices[0], indices[-1] + 1) if contiguous else indices
