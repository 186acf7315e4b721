"""Where a robot's arm joints bring its tool centre point, by SAPIEN's own model of the robot.

`kinematics.tree` says the same in double precision; experts plan with SAPIEN's model, whose poses
are of single precision, because their recordings are equal to the last bit only so, and because it
solves for a pose in a tenth of the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sapien

from kinematics.rotations import Floats
from simulation.world import World


class ArmModel:
    """The kinematic model of one robot of a world; joints that are not the arm's stay at zero.

    Attributes:
        joints: The arm's joints, in the order of everything here.
        index: Where they are among all joints in SAPIEN's order.
        dof: Number of all joints.
        low: Their lower limits (rad).
        high: Their upper limits (rad).
        base: Pose of the robot's base in the world.
        model: SAPIEN's model of the robot.
        tcp: The model's number of the TCP link.
    """

    def __init__(self, world: World, robot: str) -> None:
        """Take the robot's kinematic model.

        Args:
            world: The world it stands in; only its placement and joints are read.
            robot: Its name in the layout.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
        """
        descriptor, simulated = world.layout[robot].robot, world.robots[robot]
        self.joints = descriptor.arm_joints
        self.base = simulated.base_pose
        self.model: Any = simulated.articulation.create_pinocchio_model()
        self.tcp = simulated.articulation.links.index(simulated.link(descriptor.tcp_link))
        names = [joint.name for joint in simulated.joints]
        self.index = np.array([names.index(joint) for joint in self.joints])
        self.dof = len(names)
        limits = np.concatenate([joint.limits for joint in simulated.joints])
        self.low, self.high = limits[self.index].astype(float).T

    def tcp_pose(self, arm: Any) -> sapien.Pose:
        """Return where arm joints, (arm joints,) (rad), bring the TCP link, in the world."""
        qpos = np.zeros(self.dof)
        qpos[self.index] = arm
        self.model.compute_forward_kinematics(qpos)
        return self.base * self.model.get_link_pose(self.tcp)

    def forward(self, arm: Any) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP link: position (3,) (m), quaternion (4,) wxyz."""
        pose = self.tcp_pose(arm)
        return np.array(pose.p, float), np.array(pose.q, float)
