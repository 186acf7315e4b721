"""Where each frame and joint of a world stands in a read-out, and what is read later."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, Literal, NamedTuple, TypeVar

import numpy as np

from layouts import Layout
from robots import Fingers, RobotDescriptor, SimulationError, UnknownNameError
from robots.descriptor import Vector3
from simulation.backend import Backend, Built, BuiltRobot, Pair, Velocity
from simulation.maths import Floats

Place = TypeVar("Place")
Key = TypeVar("Key", bound=Hashable)
MeanFrame = tuple[int, list[int], Vector3]


class Lost(NamedTuple):
    """Something that is nowhere.

    Attributes:
        what: It, in words.
        env: Its world's number.
        robot: Its name in the layout, if it is a robot.
    """

    what: str
    env: int
    robot: str | None = None


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


class Declared(Generic[Key]):
    """What somebody asks for after every step, numbered in the order in which it was first asked.

    Attributes:
        keys: All of it; the same tuple until something new joins.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.keys: tuple[Key, ...] = ()
        self._numbers: dict[Key, int] = {}

    def number(self, key: Key) -> int:
        """Return the number of something, adding it if it is new."""
        found = self._numbers.get(key)
        if found is None:
            found = self._numbers[key] = len(self.keys)
            self.keys = (*self.keys, key)
        return found


class Moment:
    """What can be read of a simulation until it moves on.

    Attributes:
        past: Whether it has moved on.
    """

    __slots__ = ("_backend", "past")

    def __init__(self, backend: Backend) -> None:
        """Begin with the present."""
        self._backend = backend
        self.past = False

    def velocities(self, wanted: tuple[Velocity, ...]) -> Floats:
        """Return velocities, (K, N, 3); see `Backend`."""
        return self._present().velocities(wanted)

    def root_velocities(self) -> Floats:
        """Return velocities of the robots' roots, (R, N, 6); see `Backend`."""
        return self._present().root_velocities()

    def forces(self, pairs: tuple[Pair, ...]) -> Floats | None:
        """Return contact forces, (P, N, 3), or None; see `Backend`."""
        return self._present().forces(pairs)

    def _present(self) -> Backend:
        if self.past:
            raise SimulationError(
                "velocities and contacts were asked of a state that is no longer the present one;"
                " read them before the next step or reset"
            )
        return self._backend


class ReadoutIndex:
    """Places of bodies, links, tool centre points and joints, the same in a batch's every world.

    The frames are the backend's, then the tool centre points that lie between links. The joints of
    each robot are in the order of its descriptor.

    Attributes:
        robots: What is known of each robot, in layout order.
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
        loaded_order: For each robot `BuiltRobot.loaded_order`, or None if it is the descriptor's.
        mean_frames: For each frame that lies between or beside links: the frame that orients it,
            the frames whose mean is its origin, and what lies between that and it, in the frame
            that orients it (m).
        pairs: Pairs of frames whose distance was asked for.
        velocities: Velocities of bodies that were asked for.
        forces: Pairs whose contact force was asked for.
    """

    def __init__(self, layout: Layout, built: Built) -> None:
        """Index worlds that were built alike."""
        self.robots: Places[BuiltRobot] = Places(_ROBOT)
        self.robots.update(built.robots)
        self.frames, self.dof = built.frames, 0
        self.bodies: Places[int] = Places("body of this world")
        self.bodies.update(built.bodies)
        self.links: Places[Places[int]] = Places(_ROBOT)
        self.tcps: Places[int] = Places(_ROBOT)
        self.joints: Places[slice] = Places(_ROBOT)
        self.arm_joints: Places[slice | list[int]] = Places(_ROBOT)
        self.fingers: Places[Fingers | None] = Places(_ROBOT)
        self.grippers: Places[tuple[list[int], np.float32]] = Places(_ROBOT)
        self.bases: Places[int] = Places(_ROBOT)
        self.loaded_order: Places[list[int] | None] = Places(_ROBOT)
        self.mean_frames: list[MeanFrame] = []
        self.pairs = FramePairs()
        self.velocities: Declared[Velocity] = Declared()
        self.forces: Declared[Pair] = Declared()
        self._grasps: dict[tuple[str, str], list[int]] = {}
        for name, placement in layout.items():
            self._add_robot(name, placement.robot, built.robots[name])

    def velocity(self, body: str, kind: Literal["linear", "angular"]) -> int:
        """Return the number of a body's velocity, declaring it if it is new."""
        self.bodies.expect(body)
        return self.velocities.number(Velocity(body, kind))

    def force(self, robot: str, link: str, body: str) -> int:
        """Return the number of the force of a body on a link, declaring it if it is new."""
        self.links[robot].expect(link)
        self.bodies.expect(body)
        return self.forces.number(Pair(robot, link, body))

    def grasp(self, robot: str, body: str) -> list[int]:
        """Return the numbers of the forces of a body on both fingers of a robot that has some."""
        found = self._grasps.get((robot, body))
        if found is None:
            fingers = self.fingers[robot]
            links = () if fingers is None else fingers.links
            found = [self.force(robot, link, body) for link in links]
            self._grasps[robot, body] = found
        return found

    def _add_robot(self, name: str, descriptor: RobotDescriptor, built: BuiltRobot) -> None:
        links: Places[int] = Places(f"link of {name}")
        links.update(built.links)
        self.links[name] = links
        arm, gripper = list[int](), list[int]()
        for i, joint in enumerate(descriptor.joints, self.dof):
            (arm if joint in descriptor.arm_joints else gripper).append(i)
        self.arm_joints[name] = _as_slice(arm)
        widest = sum(built.limits[i - self.dof, 1] for i in gripper)
        self.grippers[name] = gripper, np.float32(widest)
        order = list(built.loaded_order)
        self.loaded_order[name] = None if order == sorted(order) else order
        self.bases[name] = links[built.root]
        self.joints[name] = slice(self.dof, self.dof + descriptor.dof)
        self.dof += descriptor.dof
        self.fingers[name] = descriptor.fingers
        self.tcps[name] = self._tcp_frame(links, descriptor)

    def _tcp_frame(self, links: Places[int], descriptor: RobotDescriptor) -> int:
        orientation = links[descriptor.tcp_link]
        if not descriptor.tcp_position_links and not any(descriptor.tcp_offset):
            return orientation
        origins = [links[x] for x in descriptor.tcp_position_links] or [orientation]
        self.mean_frames.append((orientation, origins, descriptor.tcp_offset))
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
