"""Arms as SAPIEN's own model of what was built has them, and the search with which they are driven.

`robot_layouts.simulation.solvers.TreeArm` says the same in double precision; experts plan with
SAPIEN's model, whose poses are of single precision, because their recordings are equal to the last
bit only so, and because it solves for a pose in a tenth of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien.wrapper.pinocchio_model import PinocchioModel

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.sapien3.robot import SimulatedRobot
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.solvers import ARM_SEARCH, Numbers
from robots import DescriptorError, UnknownNameError
from robots.urdf.checks import link_of

_DAMPING = 1e-6


class SapienArm:
    """The kinematic model of one arm of a world; see `robot_layouts.simulation.solvers.ArmModel`.

    Attributes:
        descriptor: The robot, or the limb described like one.
        joints: The arm's joints, in the order of everything here.
        places: Where they are among the descriptor's joints.
        low: Their lower limits (rad).
        high: Their upper limits (rad).
    """

    def __init__(self, world: BuiltWorld, robot: str) -> None:
        """Take the robot's kinematic model.

        Args:
            world: The world it stands in; only its placement and joints are read.
            robot: Its name in the layout.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
        """
        owner = world.layout.owner(robot)
        descriptor, simulated = world.layout.arm(robot).robot, world.robots[owner]
        placement = world.layout[owner]
        whole = placement.robot.joints
        self.descriptor, self.joints = descriptor, descriptor.arm_joints
        self._base = simulated.base_pose
        self._model: Any = simulated.articulation.create_pinocchio_model()
        self._tcp = simulated.articulation.links.index(simulated.link(descriptor.tcp_link))
        self.places = np.array([descriptor.joints.index(joint) for joint in self.joints])
        order = np.array(simulated.active_index)  # of the robot's joints in SAPIEN's
        self._start = np.empty(len(order))
        self._start[order] = placement.start_qpos
        self._order = order[[whole.index(joint) for joint in descriptor.joints]]
        limits = np.concatenate([joint.limits for joint in simulated.joints])
        self.low, self.high = limits[self._order[self.places]].astype(float).T
        x, y, z = descriptor.tcp_offset
        self._offset = sapien.Pose([x, y, z]) if x or y or z else None

    def link_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link; see `ArmModel`."""
        return _numbers(self._pose(arm))

    def tcp_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP; see `ArmModel`."""
        pose = self._pose(arm)
        return _numbers(pose if self._offset is None else pose * self._offset)

    def place_of(self, point: Floats, arm: Floats, /) -> Floats:
        """Return where arm joints bring a point of the TCP link; see `ArmModel`."""
        matrix = np.array(self._pose(arm).to_transformation_matrix(), float)
        return matrix[:3, :3] @ point + matrix[:3, 3]

    def descend(self, position: Numbers, quaternion: Numbers, starts: Floats, /) -> list[Floats]:
        """Return the arm joints at which a descent from each start ends; see `ArmModel`."""
        target = self._base.inv() * sapien.Pose(list(position), list(quaternion))
        if self._offset is not None:
            target = target * self._offset.inv()
        mask = np.zeros(len(self._start), np.int32)
        mask[self._order[self.places]] = 1
        found: list[Floats] = []
        for start in starts:
            initial = self._start.copy()
            initial[self._order] = start
            qpos, arrived, _ = self._model.compute_inverse_kinematics(
                self._tcp,
                target,
                initial_qpos=initial,
                active_qmask=mask,
                eps=ARM_SEARCH.tolerance,
                max_iterations=ARM_SEARCH.steps,
                dt=ARM_SEARCH.share,
                damp=_DAMPING,
            )
            if arrived:
                found.append(qpos[self._order[self.places]])
        return found

    def _pose(self, arm: Any) -> sapien.Pose:
        """Return where arm joints, (arm joints,) (rad), bring the TCP link, in the world."""
        qpos = self._start.copy()
        qpos[self._order[self.places]] = arm
        self._model.compute_forward_kinematics(qpos)
        return self._base * self._model.get_link_pose(self._tcp)


def _numbers(pose: sapien.Pose) -> tuple[Floats, Floats]:
    """Return the position, (3,) (m), and the quaternion, (4,) wxyz, of a pose."""
    return np.array(pose.p, float), np.array(pose.q, float)


_MAX_ITERATIONS = 100  # mani_skill 3.0.1, agents/controllers/utils/kinematics.py
_GRAVITY = [0, 0, -9.81]  # as there; it moves nothing here

# What Pinocchio reads of a joint, and what its parser insists on, 0 if left out; its search does
# not use limits.
_PARTS = ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")
_FIXED_PARTS = _PARTS[:4]
_DEFAULTS = {
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
}


class PinocchioFollower:
    """Follows poses of one link of a robot; see `robot_layouts.simulation.backend.PoseFollower`.

    It is SAPIEN's Pinocchio, on the robot's own URDF and with native's arguments: its results are
    native's to the last bit.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        urdf: bytes,
        link: str,
        root_link: str | None,
        joints: Sequence[str],
    ) -> None:
        """Read the robot's kinematic model.

        Args:
            robot: The robot, for the order of its joints and links.
            urdf: Its URDF's contents.
            link: The link that is to follow.
            root_link: Link whose frame poses are in; the robot's root if None.
            joints: Those that may move.

        Raises:
            UnknownNameError: If the robot has no such link.
            DescriptorError: If the joints do not move the link.
        """
        for name in (link, root_link):
            if name is not None:
                robot.link(name)
        tree = _Subtree(urdf, root_link)
        active = [joint.name for joint in robot.joints if joint.name in tree.joints]
        links = [name for name in robot.links if name in tree.links]
        if link not in links:
            raise UnknownNameError(f"link beyond {root_link}", link, links)
        idle = [joint for joint in joints if joint not in tree.path(link)]
        if len(idle) == len(joints):
            raise DescriptorError(
                f"{robot.descriptor.name}: none of {', '.join(joints)} moves {link}"
            )
        self._pose: Any = sapien.Pose
        self._model: Any = PinocchioModel(tree.text, _GRAVITY)
        self._model.set_joint_order(active)
        self._model.set_link_order(links)
        self._link = links.index(link)
        declared = robot.descriptor.joints
        self._taken: NDArray[np.intp] = np.array([declared.index(joint) for joint in active])
        self._moved: NDArray[np.intp] = np.array([active.index(joint) for joint in joints])
        self._mask = np.zeros(len(active), np.int32)
        self._mask[self._moved] = 1

    def follow(
        self, position: Numbers, quaternion: Numbers, qpos: NDArray[np.float32], /
    ) -> NDArray[np.float64] | None:
        """Return the joints, or None; see `robot_layouts.simulation.backend.PoseFollower`."""
        found, solved, _ = self._model.compute_inverse_kinematics(
            self._link,
            self._pose(position, quaternion),
            initial_qpos=qpos[self._taken],
            active_qmask=self._mask,
            max_iterations=_MAX_ITERATIONS,
        )
        return found[self._moved] if solved else None


class _Subtree:
    """What a link of a URDF holds, itself the root; all of the URDF if it is None.

    Attributes:
        text: Its XML.
        links: Names of its links.
        joints: Names of its joints.
    """

    def __init__(self, urdf: bytes, root_link: str | None) -> None:
        root = ElementTree.fromstring(urdf)
        _leave_out(root)
        self._above = {link_of(joint, "child"): joint for joint in root.iterfind("joint")}
        if root_link is not None:
            for element in list(root):
                joint = element.tag == "joint"
                last = link_of(element, "child") if joint else element.get("name", "")
                beyond = root_link in self._links_above(last)
                if not beyond or (joint and last == root_link):
                    root.remove(element)
        self.text = ElementTree.tostring(root, encoding="unicode")
        self.links = {link.get("name", "") for link in root.iterfind("link")}
        self.joints = {joint.get("name", "") for joint in root.iterfind("joint")}

    def path(self, link: str) -> set[str]:
        """Return the joints that move a link."""
        return {
            self._above[name].get("name", "")
            for name in self._links_above(link)
            if name in self._above
        }

    def _links_above(self, link: str) -> list[str]:
        """Return a link and all that it hangs on."""
        chain = [link]
        while (joint := self._above.get(chain[-1])) is not None:
            chain.append(link_of(joint, "parent"))
        return chain


def _leave_out(root: ElementTree.Element) -> None:
    """Leave out what Pinocchio does not read, some of which it stumbles over, and set defaults."""
    for element in list(root):
        if element.tag not in ("link", "joint"):
            root.remove(element)
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for joint in root.iterfind("joint"):
        used = _FIXED_PARTS if joint.get("type") == "fixed" else _PARTS
        for part in list(joint):
            if part.tag not in used:
                joint.remove(part)
            for key in _DEFAULTS.get(part.tag, ()):
                part.set(key, part.get(key, "0"))
