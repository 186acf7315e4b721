"""Turns where an arm should go into a robot's action numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots import JointGroup, RobotDescriptor
from robots.action_split import is_gripper

GAIN = 2.0  # of the joint error; PhysX's drive follows about 0.4 of a target in one step


class ArmDriver:
    """Drives one robot's arm towards a goal; generated from its action split."""

    def __init__(self, descriptor: RobotDescriptor) -> None:
        """Take a robot."""
        self._place = {joint: i for i, joint in enumerate(descriptor.joints)}
        self._arm_joints = descriptor.arm_joints
        self._groups = dict(descriptor.action_split.groups)

    def arm(self, qpos: Floats) -> Floats:
        """Pick the arm's joints out of all joints in the descriptor's order, (dof,)."""
        return qpos[[self._place[joint] for joint in self._arm_joints]]

    def action(self, goal: Floats, gripper: float, qpos: Floats) -> Floats:
        """Return the action numbers, arm joints slowed alike so that they arrive together.

        Args:
            goal: Arm joints to reach, in the descriptor's order (rad).
            gripper: Action number of the gripper, if there is one.
            qpos: All joints now, in the descriptor's order, (dof,) (rad, m).
        """
        goals = dict(zip(self._arm_joints, goal, strict=True))
        parts: list[Floats] = []
        for name, group in self._groups.items():
            if is_gripper(name) or group.held:
                parts.append(np.full(group.size, gripper))
            else:
                parts.append(self._towards(group, goals, qpos))
        return np.concatenate(parts)

    def _towards(self, group: JointGroup, goals: Mapping[str, float], qpos: Floats) -> Floats:
        target = np.array([goals[joint] for joint in group.joints])
        low, high = np.array(group.ranges).T
        if not group.delta:
            return (2 * target - high - low) / (high - low)
        error = target - qpos[[self._place[joint] for joint in group.joints]]
        numbers = (2 * GAIN * error - high - low) / (high - low)
        return numbers / max(1.0, np.abs(numbers).max())
