"""Inverse kinematics by SAPIEN's own model of what was built: poses, and points, of a TCP.

`robot_layouts.kinematics.tree` says the same in double precision; experts plan with SAPIEN's model,
whose poses are of single precision, because their recordings are equal to the last bit only so, and
because it solves for a pose in a tenth of the time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import sapien
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.solve import by_way, descend_by_differences, nearby, turned_within
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import SimulationError, UnknownNameError

Numbers = Sequence[float] | NDArray[np.floating[Any]]

_MAX_ITERATIONS = 200  # converges in 40 … 80 where a solution exists
_STEP = 0.3  # of the way to the linearised solution, per iteration
_DAMPING = 1e-6
_CONVERGED = 1e-4  # norm of the pose error (m and rad together)
_NEARBY_STARTS, _SPREAD = 16, 0.5  # number, standard deviation (rad)
_ARRIVED = 1e-3  # m
_SHORT_WAY, _LONG_WAY = 0.001, 0.5  # m of error that a joint's way of so many rad is worth


class ArmModel:
    """The kinematic model of one arm of a world; other joints stay where the layout starts them.

    Attributes:
        joints: The arm's joints, in the order of everything here.
        places: Where they are among those of the robot, or of the limb if the arm is one.
        low: Their lower limits (rad).
        high: Their upper limits (rad).
        base: Pose of the robot's base in the world.
        model: SAPIEN's model of the robot.
        tcp: The model's number of the TCP link.
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
        self.joints = descriptor.arm_joints
        self.base = simulated.base_pose
        self.model: Any = simulated.articulation.create_pinocchio_model()
        self.tcp = simulated.articulation.links.index(simulated.link(descriptor.tcp_link))
        self.places = np.array([descriptor.joints.index(joint) for joint in self.joints])
        order = np.array(simulated.active_index)  # of the robot's joints in SAPIEN's
        self._start = np.empty(len(order))
        self._start[order] = placement.start_qpos
        self._order = order[[whole.index(joint) for joint in descriptor.joints]]
        limits = np.concatenate([joint.limits for joint in simulated.joints])
        self.low, self.high = limits[self._order[self.places]].astype(float).T

    def tcp_pose(self, arm: Any) -> sapien.Pose:
        """Return where arm joints, (arm joints,) (rad), bring the TCP link, in the world."""
        qpos = self._start.copy()
        qpos[self._order[self.places]] = arm
        self.model.compute_forward_kinematics(qpos)
        return self.base * self.model.get_link_pose(self.tcp)

    def forward(self, arm: Any) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link: position (3,) (m), quaternion (4,) wxyz."""
        pose = self.tcp_pose(arm)
        return np.array(pose.p, float), np.array(pose.q, float)

    def descend(self, target: sapien.Pose, start: Floats, **settings: float) -> Floats | None:
        """Return the arm joints at which SAPIEN's descent ends, or None if it does not converge.

        Args:
            target: Of the TCP link, in the frame of the robot's base.
            start: All joints of the robot or limb in its descriptor's order, (dof,) (rad, m); those
                that are not the arm's stay there.
            settings: What ``compute_inverse_kinematics`` takes besides.
        """
        initial, mask = self._start.copy(), np.zeros(len(self._start), np.int32)
        initial[self._order] = start
        mask[self._order[self.places]] = 1
        qpos, converged, _ = self.model.compute_inverse_kinematics(
            self.tcp, target, initial_qpos=initial, active_qmask=mask, **settings
        )
        return qpos[self._order[self.places]] if converged else None


class InverseKinematics:
    """Solves for the arm of one robot of a world; fingers stay where they are.

    Attributes:
        joints: The arm's joints, in the order of the solutions.
    """

    def __init__(self, world: BuiltWorld, robot: str) -> None:
        """Take the robot's kinematic model.

        Args:
            world: The world it stands in; only its placement and joints are read.
            robot: Its name in the layout.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
            SimulationError: If the robot's TCP is not a link but a mean of several.
        """
        descriptor = world.layout.arm(robot).robot
        if descriptor.tcp_position_links:
            raise SimulationError(
                f"inverse kinematics needs a TCP that is a link; that of {descriptor.name} is the"
                f" mean of {', '.join(descriptor.tcp_position_links)}"
            )
        self._arm = arm = ArmModel(world, robot)
        self.joints = arm.joints
        x, y, z = descriptor.tcp_offset
        self._offset = sapien.Pose([x, y, z]) if x or y or z else None
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
        target = self._arm.base.inv() * sapien.Pose(list(position), list(quaternion))
        if self._offset is not None:
            target = target * self._offset.inv()
        all_joints = np.asarray(start_qpos, float)
        found: list[Floats] = []
        for start in self._starts(all_joints):
            arm = self._arm.descend(
                target,
                start,
                eps=_CONVERGED,
                max_iterations=_MAX_ITERATIONS,
                dt=_STEP,
                damp=_DAMPING,
            )
            if arm is not None:
                arm = turned_within(arm, self._arm.low, self._arm.high)
            if arm is not None:
                found.append(arm)
        return by_way(found, all_joints[self._arm.places])

    def forward(self, arm_qpos: Numbers) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP: position (3,) (m) and quaternion (4,) wxyz, world.

        Args:
            arm_qpos: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        if self._offset is None:
            return self._arm.forward(arm_qpos)
        pose = self._arm.tcp_pose(arm_qpos) * self._offset
        return np.array(pose.p, float), np.array(pose.q, float)

    def _starts(self, qpos: Floats) -> Iterator[Floats]:
        yield qpos
        yield from self._keyframes
        yield from nearby(qpos, self._arm.places, _NEARBY_STARTS, _SPREAD)


class PointReach:
    """Solves for the arm joints that bring a point of a robot's TCP link to a place.

    Attributes:
        joints: The arm's joints, in the order of the solutions.
    """

    def __init__(self, world: BuiltWorld, robot: str) -> None:
        """Take the robot's kinematic model.

        Args:
            world: The world it stands in; only its placement and joints are read.
            robot: Its name in the layout.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
        """
        self._model = ArmModel(world, robot)
        self.joints = self._model.joints

    def arm(self, qpos: Floats) -> Floats:
        """Pick the arm's joints out of all in the descriptor's order."""
        return qpos[self._model.places]

    def forward(self, arm: Floats) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link: position (3,) (m), quaternion (4,) wxyz.

        Args:
            arm: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        return self._model.forward(arm)

    def place_of(self, point: Floats, arm: Floats) -> Floats:
        """Return where arm joints bring a point, (3,) (m), world.

        Args:
            point: In the frame of the TCP link, (3,) (m).
            arm: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        matrix = np.array(self._model.tcp_pose(arm).to_transformation_matrix(), float)
        return matrix[:3, :3] @ point + matrix[:3, 3]

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

        def errors(arm: Floats) -> Floats:
            way = _SHORT_WAY * ((arm - start)[free] / _LONG_WAY) ** 3  # the longest counts most
            return np.concatenate([self.place_of(point, arm) - place, way])

        arm = descend_by_differences(errors, start, free)
        arm = np.clip(arm, self._model.low, self._model.high)
        away = np.linalg.norm(self.place_of(point, arm) - place)
        return arm if away < _ARRIVED else None
