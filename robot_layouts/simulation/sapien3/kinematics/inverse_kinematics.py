"""Inverse kinematics: which arm joints bring a robot's tool centre point to a pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import sapien
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.solve import by_way, nearby, turned_within
from robot_layouts.simulation.sapien3.kinematics.arm_model import ArmModel
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import SimulationError

Numbers = Sequence[float] | NDArray[np.floating[Any]]

_MAX_ITERATIONS = 200  # converges in 40 … 80 where a solution exists
_STEP = 0.3  # of the way to the linearised solution, per iteration
_DAMPING = 1e-6
_CONVERGED = 1e-4  # norm of the pose error (m and rad together)
_NEARBY_STARTS, _SPREAD = 16, 0.5  # number, standard deviation (rad)


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
