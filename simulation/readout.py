"""Where each frame and joint of a world stands in a read-out."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from robots import Fingers, UnknownNameError
from simulation.world import World

Place = TypeVar("Place")


class Places(dict[str, Place]):
    """A dict that says which names there are when one is missing."""

    def __init__(self, kind: str) -> None:
        """Take what the names are names of, in the singular."""
        super().__init__()
        self.kind = kind

    def __missing__(self, name: str) -> Place:
        """Refuse an unknown name."""
        raise UnknownNameError(self.kind, name, self)

    def expect(self, *names: str) -> None:
        """Refuse unknown names."""
        for name in names:
            if name not in self:
                self.__missing__(name)


class ReadoutIndex:
    """Places of bodies, links, tool centre points and joints, the same in a batch's every world.

    A frame is anything with a pose: SAPIEN's entities in their own order, then the tool centre
    points that lie between links.

    Attributes:
        entities: Number of entities.
        frames: Number of frames.
        dof: Number of joints of all robots.
        bodies: Frame of each body.
        links: Frame of each robot's links.
        tcps: Frame of each robot's tool centre point.
        joints: Places of each robot's joints, in layout order.
        arm_joints: Places of each robot's joints that are not its gripper's.
        fingers: Each robot's grasping links.
        grippers: Places of each robot's gripper joints, and the sum of their upper limits (m).
        bases: Frame of each robot's root link.
        mean_frames: For each frame that lies between links: itself, the frame that orients it,
            and the frames whose mean is its origin.
        pairs: Pairs of frames whose distance was asked for.
        velocities: Bodies and which of their velocities was asked for, with their numbers: from
            the second step on a state reads all at once.
    """

    def __init__(self, world: World) -> None:
        """Index one world."""
        place = {entity: i for i, entity in enumerate(world.scene.entities)}
        self.entities = self.frames = len(place)
        self.dof = 0
        self.bodies: Places[int] = Places("body of this world")
        self.links: Places[Places[int]] = Places(_ROBOT)
        self.tcps: Places[int] = Places(_ROBOT)
        self.joints: Places[slice] = Places(_ROBOT)
        self.arm_joints: Places[slice | list[int]] = Places(_ROBOT)
        self.fingers: Places[Fingers | None] = Places(_ROBOT)
        self.grippers: Places[tuple[list[int], np.float32]] = Places(_ROBOT)
        self.bases: Places[int] = Places(_ROBOT)
        self.mean_frames: list[tuple[int, int, list[int]]] = []
        self.pairs = FramePairs()
        self.velocities: dict[tuple[str, str], int] = {}
        self.bodies.update({name: place[body.entity] for name, body in world.bodies.items()})
        for name, robot in world.robots.items():
            descriptor = robot.descriptor
            links: Places[int] = Places(f"link of {name}")
            self.links[name] = links
            links.update({link: place[part.entity] for link, part in robot.links.items()})
            driven = zip(descriptor.joints, robot.active_index, strict=True)
            self.arm_joints[name] = _as_slice(
                sorted(self.dof + i for joint, i in driven if joint in descriptor.arm_joints)
            )
            self.grippers[name] = self._gripper(name, world)
            self.bases[name] = place[robot.articulation.links[0].entity]
            self.joints[name] = slice(self.dof, self.dof + len(robot.joints))
            self.dof += len(robot.joints)
            self.fingers[name] = descriptor.fingers
            self.tcps[name] = self._tcp_frame(name, world)

    def velocity(self, body: str, which: str) -> int:
        """Return the number of a body's velocity, adding it if it is new."""
        self.bodies.expect(body)
        return self.velocities.setdefault((body, which), len(self.velocities))

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
        orientation = self.links[name][descriptor.tcp_link]
        if not descriptor.tcp_position_links:
            return orientation
        points = [self.links[name][link] for link in descriptor.tcp_position_links]
        self.mean_frames.append((self.frames, orientation, points))
        self.frames += 1
        return self.frames - 1


class FramePairs:
    """Pairs of frames that somebody asks the distance of, so that all are computed in one go.

    A task asks for the same distances after every step: from the second step on they are one
    subtraction and one norm over all pairs.

    Attributes:
        starts: First frame of every pair, (K,).
        ends: Second frame of every pair, (K,).
        planar: Numbers of the pairs whose distance is seen from above.
    """

    def __init__(self) -> None:
        """Start without pairs."""
        self._places: dict[tuple[int, int, bool], int] = {}
        self.starts = self.ends = self.planar = np.empty(0, np.intp)

    def place(self, start: int, end: int, *, planar: bool) -> int:
        """Return the number of a pair, adding it if it is new."""
        found = self._places.get((start, end, planar))
        if found is None:
            found = self._places[start, end, planar] = len(self._places)
            self.starts, self.ends, planar_flags = np.array(list(self._places), np.intp).T
            self.planar = np.flatnonzero(planar_flags)
        return found


_ROBOT = "robot of this layout"


def _as_slice(indices: list[int]) -> slice | list[int]:
    if not indices:  # a hand without an arm
        return slice(0, 0)
    contiguous = indices == list(range(indices[0], indices[0] + len(indices)))
    return slice(indices[0], indices[-1] + 1) if contiguous else indices
