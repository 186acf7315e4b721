"""Inverse kinematics of a point, for arms of too few joints to choose an orientation as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.solve import descend_by_differences
from robot_layouts.simulation.sapien3.kinematics.arm_model import ArmModel
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import UnknownNameError

_CONVERGED = 1e-3  # m
_SHORT_WAY, _LONG_WAY = 0.001, 0.5  # m of error that a joint's way of so many rad is worth


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
        return arm if away < _CONVERGED else None
