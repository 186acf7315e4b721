"""Where a robot's arm joints bring its tool centre point, by SAPIEN's own model of the robot.

`tree` says the same in double precision; experts plan with SAPIEN's model, whose poses
are of single precision, because their recordings are equal to the last bit only so, and because it
solves for a pose in a tenth of the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sapien

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.sapien3.world import BuiltWorld


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
