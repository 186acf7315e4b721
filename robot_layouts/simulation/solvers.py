"""Inverse kinematics for any simulator: poses and points of a TCP, and pose following.

What a backend answers `Backend.inverse_kinematics`, `point_reach` and `pose_follower` with:

    InverseKinematics(TreeArm(layout, robot, base))
    PointReach(TreeArm(layout, robot, base))
    TreeFollower(layout[robot].robot, link, root_link, joints)

where ``base`` is the pose of the robot's base in the first world, as a `layouts.frames.Pose`. They
read the robot's own file and ask no simulator. `robot_layouts.simulation.sapien3` answers with a
model and a follower of its own, since clones and published episodes owe their last bits to these.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from layouts.frames import Pose
from robot_layouts.kinematics.chain import Chain, Search
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix, quaternion_of
from robot_layouts.kinematics.solve import by_way, descend_by_differences, nearby, turned_within
from robot_layouts.kinematics.tree import Tree
from robots import DescriptorError, RobotDescriptor, SimulationError, UnknownNameError
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree, link_index

Numbers = Sequence[float] | NDArray[np.floating[Any]]

ARM_SEARCH = Search(steps=200, share=0.3)  # converges in 40 … 80 where a solution exists
# mani_skill 3.0.1, agents/controllers/utils/kinematics.py
FOLLOWING = Search(steps=100, share=0.1)

_NEARBY_STARTS, _SPREAD = 16, 0.5  # number, standard deviation (rad)
_ARRIVED = 1e-3  # m
_SHORT_WAY, _LONG_WAY = 0.001, 0.5  # m of error that a joint's way of so many rad is worth


class ArmModel(Protocol):
    """What knows where the joints of an arm bring its TCP; its other joints stay where they start.

    Attributes:
        descriptor: The robot, or the limb described like one.
        joints: The arm's joints, in the order of everything here.
        places: Where they are among the descriptor's joints.
        low: Their lower limits (rad).
        high: Their upper limits (rad).
    """

    descriptor: RobotDescriptor
    joints: tuple[str, ...]
    places: NDArray[np.intp]
    low: Floats
    high: Floats

    def link_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link: position (3,) (m), quaternion (4,) wxyz."""
        ...

    def tcp_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP, which may lie beside that link, likewise."""
        ...

    def place_of(self, point: Floats, arm: Floats, /) -> Floats:
        """Return where arm joints bring a point of the TCP link, (3,) (m), world."""
        ...

    def descend(self, position: Numbers, quaternion: Numbers, starts: Floats, /) -> list[Floats]:
        """Return the arm joints at which a descent from each start brings the TCP to a pose.

        Starts from which it does not arrive are left out, and limits are not looked at.

        Args:
            position: Of the TCP in the world, (3,) (m).
            quaternion: Likewise, wxyz.
            starts: All joints in the descriptor's order, (n, dof) (rad, m).
        """
        ...


class InverseKinematics:
    """Solves for the arm of one robot of a world; fingers stay where they are.

    Attributes:
        joints: The arm's joints, in the order of the solutions.
    """

    def __init__(self, arm: ArmModel) -> None:
        """Take an arm.

        Raises:
            SimulationError: If the robot's TCP is not a link but a mean of several.
        """
        descriptor = arm.descriptor
        if descriptor.tcp_position_links:
            raise SimulationError(
                f"inverse kinematics needs a TCP that is a link; that of {descriptor.name} is the"
                f" mean of {', '.join(descriptor.tcp_position_links)}"
            )
        self._arm, self.joints = arm, arm.joints
        self._keyframes = np.array([*descriptor.keyframes.values()], float)

    def solve(self, position: Numbers, quaternion: Numbers, start_qpos: Numbers) -> Floats | None:
        """Return the first of `solutions`, or None if there are none."""
        return next(iter(self.solutions(position, quaternion, start_qpos)), None)

    def solutions(
        self, position: Numbers, quaternion: Numbers, start_qpos: Numbers
    ) -> list[Floats]:
        """Return arm joints that bring the TCP to a pose, within the joint limits.

        Tries from where the robot is, from its keyframes, and from the same few places around
        where it is. The first solution is the one whose farthest joint has the shortest way to go.

        Args:
            position: Of the TCP in the world (m).
            quaternion: Of the TCP in the world, wxyz.
            start_qpos: All joints in the descriptor's order, (dof,) (rad, m); the solution is
                sought near them.

        Returns:
            Positions in the order of ``joints``, each (arm joints,) (rad).
        """
        arm, qpos = self._arm, np.asarray(start_qpos, float)
        around = nearby(qpos, arm.places, _NEARBY_STARTS, _SPREAD)
        starts = np.concatenate([qpos[None], self._keyframes.reshape(-1, len(qpos)), around])
        turned = (
            turned_within(found, arm.low, arm.high)
            for found in arm.descend(position, quaternion, starts)
        )
        return by_way([found for found in turned if found is not None], qpos[arm.places])

    def forward(self, arm_qpos: Numbers) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP: position (3,) (m) and quaternion (4,) wxyz, world.

        Args:
            arm_qpos: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        return self._arm.tcp_pose(arm_qpos)


class PointReach:
    """Solves for the arm joints that bring a point of a robot's TCP link to a place.

    Attributes:
        joints: The arm's joints, in the order of the solutions.
        middle: Of the range of each, or of what is within ±π of it (rad).
    """

    def __init__(self, arm: ArmModel) -> None:
        """Take an arm."""
        self._model, self.joints = arm, arm.joints
        self.middle = np.clip([arm.low, arm.high], -pi, pi).mean(axis=0)

    def arm(self, qpos: Floats) -> Floats:
        """Pick the arm's joints out of all in the descriptor's order."""
        return qpos[self._model.places]

    def forward(self, arm: Floats) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link: position (3,) (m), quaternion (4,) wxyz.

        Args:
            arm: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        return self._model.link_pose(arm)

    def place_of(self, point: Floats, arm: Floats) -> Floats:
        """Return where arm joints bring a point, (3,) (m), world.

        Args:
            point: In the frame of the TCP link, (3,) (m).
            arm: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        return self._model.place_of(point, arm)

    def solve(
        self, point: Floats, place: Floats, start: Floats, fixed: Sequence[str] = ()
    ) -> Floats | None:
        """Return arm joints near ``start`` that bring a point to a place, or None if none do.

        Args:
            point: In the frame of the TCP link, (3,) (m).
            place: Where it is to be in the world, (3,) (m).
            start: Positions in the order of ``joints``, shape (arm joints,) (rad).
            fixed: Joints that stay as they are.

        Returns:
            Positions in the order of ``joints``, within their limits, (arm joints,) (rad).

        Raises:
            UnknownNameError: If a fixed joint is not one of ``joints``.
        """
        for joint in fixed:
            if joint not in self.joints:
                raise UnknownNameError("arm joint", joint, self.joints)
        free = [i for i, joint in enumerate(self.joints) if joint not in fixed]

        def away(arm: Floats) -> Floats:
            return self.place_of(point, arm) - place

        def errors(arm: Floats) -> Floats:
            way = _SHORT_WAY * ((arm - start)[free] / _LONG_WAY) ** 3  # the longest counts most
            return np.concatenate([away(arm), way])

        limits = np.stack([self._model.low, self._model.high], axis=1)
        arm = np.clip(descend_by_differences(errors, start, free), *limits.T)
        if np.linalg.norm(away(arm)) >= _ARRIVED:  # a long way, or one along limits
            arm = descend_by_differences(away, start, free, limits)
        return arm if np.linalg.norm(away(arm)) < _ARRIVED else None


class TreeArm:
    """The arm of a robot, or a limb of one, as the robot's own file has it; see `ArmModel`."""

    def __init__(self, layout: Layout, robot: str, base: Pose | None = None) -> None:
        """Read the robot's links.

        Args:
            layout: The layout.
            robot: Name of the robot or the limb in it.
            base: Where the robot's base is in the world; None is where the layout has it.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
            AssetError: If the robot's files cannot be found or read.
        """
        placement = layout[layout.owner(robot)]
        self.descriptor = descriptor = layout.arm(robot).robot
        whole, tree = placement.robot.joints, tree_of(placement.robot)
        self.joints = descriptor.arm_joints
        self.places = np.array([descriptor.joints.index(joint) for joint in self.joints], np.intp)
        self._owned = np.array([whole.index(joint) for joint in descriptor.joints], np.intp)
        self._free: list[int] = self._owned[self.places].tolist()
        self.low, self.high = tree.limits[self._free].T
        self._start = np.array(placement.start_qpos, float)
        self._chain = Chain(tree, link_index(tree, descriptor.tcp_link))
        pose = placement.base_pose if base is None else base
        self._base = pose_matrix(pose.position, pose.quaternion)
        self._offset = np.eye(4)
        self._offset[:3, 3] = descriptor.tcp_offset

    def link_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link; see `ArmModel`."""
        pose = self._link_matrix(arm)
        return pose[:3, 3], quaternion_of(pose[:3, :3])

    def tcp_pose(self, arm: Numbers, /) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP; see `ArmModel`."""
        pose = self._link_matrix(arm) @ self._offset
        return pose[:3, 3], quaternion_of(pose[:3, :3])

    def place_of(self, point: Floats, arm: Floats, /) -> Floats:
        """Return where arm joints bring a point of the TCP link; see `ArmModel`."""
        pose = self._link_matrix(arm)
        return pose[:3, :3] @ point + pose[:3, 3]

    def descend(self, position: Numbers, quaternion: Numbers, starts: Floats, /) -> list[Floats]:
        """Return the arm joints at which a descent from each start ends; see `ArmModel`."""
        wanted = inverse_pose(self._base) @ pose_matrix(position, quaternion)
        rows = np.tile(self._start, (len(starts), 1))
        rows[:, self._owned] = starts
        pose = wanted @ inverse_pose(self._offset)
        found, arrived = self._chain.search(pose, rows, self._free, ARM_SEARCH)
        return list(found[arrived][:, self._free])

    def _link_matrix(self, arm: Numbers) -> Floats:
        """Return the pose of the TCP link in the world, (4, 4) (m)."""
        qpos = self._start.copy()
        qpos[self._free] = arm
        return self._base @ self._chain.end_poses(qpos[None])[0]


class TreeFollower:
    """Follows poses of one link of a robot; see `robot_layouts.simulation.backend.PoseFollower`."""

    def __init__(
        self, robot: RobotDescriptor, link: str, root_link: str | None, joints: Sequence[str]
    ) -> None:
        """Read the robot's links.

        Args:
            robot: The robot.
            link: The link that is to follow.
            root_link: Link whose frame poses are in; the robot's root if None.
            joints: Those that may move.

        Raises:
            UnknownNameError: If the robot has no such link, or none beyond ``root_link``.
            DescriptorError: If the joints do not move the link.
            AssetError: If the robot's files cannot be found or read.
        """
        tree = tree_of(robot)
        root = 0 if root_link is None else link_index(tree, root_link)
        end = link_index(tree, link)
        if root not in tree.path(end):
            beyond = [tree.links[i] for i in range(len(tree.links)) if root in tree.path(i)]
            raise UnknownNameError(f"link beyond {root_link}", link, beyond)
        self._chain = Chain(tree, end, root)
        self._free = [robot.joints.index(joint) for joint in joints]
        if not self._chain.coordinates.intersection(self._free):
            raise DescriptorError(f"{robot.name}: none of {', '.join(joints)} moves {link}")

    def follow(self, position: Numbers, quaternion: Numbers, qpos: Numbers, /) -> Floats | None:
        """Return the joints, or None; see `robot_layouts.simulation.backend.PoseFollower`."""
        pose = pose_matrix(position, quaternion)
        found, arrived = self._chain.search(pose, np.array([qpos]), self._free, FOLLOWING)
        return found[0, self._free] if arrived[0] else None


def tree_of(robot: RobotDescriptor) -> Tree:
    """Return the links of a robot, whose coordinates are its joints."""
    urdf = robot.urdf.locate()
    return kinematic_tree(read_model(read_urdf(urdf), urdf.as_posix()), robot.joints)
