"""Arms as SAPIEN's own model of what was built has them.

`robot_layouts.simulation.solvers.TreeArm` says the same in double precision; experts plan with
SAPIEN's model, whose poses are of single precision, because their recordings are equal to the last
bit only so, and because it solves for a pose in a tenth of the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sapien

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.solvers import ARM_SEARCH, Numbers

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
