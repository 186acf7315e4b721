"""Where each frame and joint of a world stands in a read-out, and what is read later."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import compress
from typing import Generic, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.backend import Backend, Built, BuiltRobot, Pair, Velocity
from robot_layouts.simulation.maths import Floats
from robots import Fingers, RobotDescriptor, SimulationError, UnknownNameError
from robots.descriptor import Vector3

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

    def rename(self, name: str, also: str) -> None:
        """Let something go by another name, too."""
        self[also] = self[name]

    def expect(self, *names: str) -> None:
        """Refuse unknown names."""
        for name in names:
            if name not in self:
                self.__missing__(name)


class Declared(Generic[Key]):
    """What is asked for after every step, numbered in the order in which it was first asked.

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

    def body_joints(self, body: str) -> Floats:
        """Return joints of a body, (N, 2 · joints); see `Backend`."""
        return self._present().body_joints(body)

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

    The limbs of a robot are robots here, by their full names and, where these are unique, by their
    short ones; links and base are then those of the whole robot.

    Attributes:
        robots: What is known of each robot, in layout order.
        frames: Number of frames.
        dof: Number of joints of all robots.
        bodies: Frame of each body.
        body_joints: Place of each joint of the bodies that have some.
        links: Frame of each robot's links.
        tcps: Frame of each robot's tool centre point.
        joints: Places of each robot's joints, in layout order.
        arm_joints: Places of each robot's joints that are not its gripper's.
        fingers: Each robot's grasping links.
        grippers: Places of each robot's gripper joints, and the sum of their upper limits (m); None
            if it has no gripper.
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
        self.body_joints: Places[Places[int]] = Places("body with joints")
        for body, joints in built.joints.items():
            places = self.body_joints[body] = Places(f"joint of {body}")
            places.update((joint, i) for i, joint in enumerate(joints))
        self.links: Places[Places[int]] = Places(_ROBOT)
        self.tcps: Places[int] = Places(_ROBOT)
        self.joints: Places[slice | list[int]] = Places(_ROBOT)
        self.arm_joints: Places[slice | list[int]] = Places(_ROBOT)
        self.fingers: Places[Fingers | None] = Places(_ROBOT)
        self.grippers: Places[tuple[slice | list[int], np.float32] | None] = Places(_ROBOT)
        self.bases: Places[int] = Places(_ROBOT)
        self.loaded_order: Places[list[int] | None] = Places(_ROBOT)
        self.mean_frames: list[MeanFrame] = []
        self.pairs = FramePairs()
        self.velocities: Declared[Velocity] = Declared()
        self.forces: Declared[Pair] = Declared()
        self._grasps: dict[tuple[str, str], NDArray[np.intp]] = {}
        self._owners: Places[str] = Places(_ROBOT)
        for name, placement in layout.items():
            self._add_robot(name, placement.robot, built.robots[name])
        for short, name in layout.short_names.items():
            self._add_name(short, name)

    def velocity(self, body: str, kind: Literal["linear", "angular"]) -> int:
        """Return the number of a body's velocity, declaring it if it is new."""
        self.bodies.expect(body)
        return self.velocities.number(Velocity(body, kind))

    def force(self, robot: str, link: str, body: str | None) -> int:
        """Return the number of the force of a body on a link, declaring it if it is new."""
        self.links[robot].expect(link)
        if body is not None:
            self.bodies.expect(body)
        return self.forces.number(Pair(self._owners[robot], link, body))

    def grasp(self, robot: str, body: str) -> NDArray[np.intp]:
        """Return the numbers of the forces of a body on both fingers of a robot that has some."""
        found = self._grasps.get((robot, body))
        if found is None:
            fingers = self.fingers[robot]
            links = () if fingers is None else fingers.links
            found = np.array([self.force(robot, link, body) for link in links], np.intp)
            self._grasps[robot, body] = found
        return found

    def _add_robot(self, name: str, descriptor: RobotDescriptor, built: BuiltRobot) -> None:
        links: Places[int] = Places(f"link of {name}")
        links.update(built.links)
        self.links[name] = links
        order = list(built.loaded_order)
        self.loaded_order[name] = None if order == sorted(order) else order
        self.bases[name] = links[built.root]
        places = range(self.dof, self.dof + descriptor.dof)
        self._add_arm(name, name, descriptor, places, built.limits)
        for part, own in descriptor.parts.items():
            joints = [descriptor.joints.index(joint) for joint in own.joints]
            at = [places[i] for i in joints]
            self._add_arm(f"{name}.{part}", name, own, at, built.limits[joints])
        self.dof += descriptor.dof

    def _add_arm(
        self,
        name: str,
        owner: str,
        descriptor: RobotDescriptor,
        joints: Sequence[int],
        limits: Floats,
    ) -> None:
        """Add what is known of a robot or a part of it by its descriptor.

        Args:
            name: Its name.
            owner: Name of the robot.
            descriptor: Its descriptor, or its part of the robot's.
            joints: Places of its joints, in layout order.
            limits: Their lower and upper limits, (dof, 2) (rad, m).
        """
        self._owners[name] = owner
        self.links[name], self.bases[name] = self.links[owner], self.bases[owner]
        arm = [joint in descriptor.arm_joints for joint in descriptor.joints]
        self.joints[name] = _as_slice(list(joints))
        self.arm_joints[name] = _as_slice(list(compress(joints, arm)))
        gripper = [descriptor.joints.index(joint) for joint in descriptor.gripper_joints]
        widest = np.float32(sum(limits[gripper, 1]))
        places = _as_slice([joints[i] for i in gripper])
        self.grippers[name] = (places, widest) if gripper else None
        self.fingers[name] = descriptor.fingers
        self.tcps[name] = self._tcp_frame(self.links[owner], descriptor)

    def _add_name(self, short: str, name: str) -> None:
        """Let a limb go by another name, too."""
        for places in (
            self.links,
            self.bases,
            self._owners,
            self.joints,
            self.arm_joints,
            self.grippers,
            self.fingers,
            self.tcps,
        ):
            places.rename(name, short)

    def _tcp_frame(self, links: Places[int], descriptor: RobotDescriptor) -> int:
        orientation = links[descriptor.tcp_link]
        if not descriptor.tcp_position_links and not any(descriptor.tcp_offset):
            return orientation
        origins = [links[x] for x in descriptor.tcp_position_links] or [orientation]
        between = orientation, origins, descriptor.tcp_offset
        if between not in self.mean_frames:
            self.mean_frames.append(between)
            self.frames += 1
        return self.frames - len(self.mean_frames) + self.mean_frames.index(between)


class FramePairs:
    """Pairs of frames whose distances are asked for, so that all are computed in one go.

    A task asks for the same distances after every step: from the second step on they are one
    subtraction and one norm over all pairs.

    Attributes:
        frames: Last and first frame of every pair, (2, K).
        planar: Numbers of the pairs whose distance is seen from above.
    """

    def __init__(self) -> None:
        """Start without pairs."""
        self._places: dict[tuple[int, int, bool], int] = {}
        self.frames = np.empty((2, 0), np.intp)
        self.planar: slice | list[int] = []

    def place(self, start: int, end: int, *, planar: bool) -> int:
        """Return the number of a pair, adding it if it is new."""
        found = self._places.get((start, end, planar))
        if found is None:
            found = self._places[start, end, planar] = len(self._places)
            self.frames = np.array([(last, first) for first, last, _ in self._places], np.intp).T
            self.planar = _as_slice([k for k, (_, _, flat) in enumerate(self._places) if flat])
        return found


_ROBOT = "robot of this layout"


def _as_slice(indices: list[int]) -> slice | list[int]:
    if not indices:  # a hand without an arm
        return slice(0, 0)
    contiguous = indices == list(range(indices[0], indices[0] + len(indices)))
    return slice(indices[0], indices[-1] + 1) if contiguous else indices
