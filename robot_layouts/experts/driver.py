"""Turns where an arm should go into a robot's action numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots import JointGroup, RobotDescriptor
from robots.action_split import is_gripper
from robots.gripper_motion import gripper_motion

GAIN = 2.0  # of the joint error at most; a Panda's drives follow 0.4 of a target in one step
PEAK = 2 / np.e  # of a critically damped drive's speed, as a share of stiffness over damping
_LEAST_DAMPING = 1e-9  # N·m·s/rad; of drives that have none


class ArmDriver:
    """Drives one robot's arm towards a goal; generated from its action split."""

    def __init__(self, descriptor: RobotDescriptor, seconds: float = 0.05) -> None:
        """Take a robot, and how long a control step takes (s)."""
        self._seconds = seconds
        self._place = {joint: i for i, joint in enumerate(descriptor.joints)}
        self._arm_joints = descriptor.arm_joints
        self._groups = dict(descriptor.action_split.groups)
        self._descriptor = descriptor

    def arm(self, qpos: Floats) -> Floats:
        """Pick the arm's joints out of all joints in the descriptor's order, (dof,)."""
        return qpos[[self._place[joint] for joint in self._arm_joints]]

    def action(
        self,
        goal: Floats,
        gripper: float,
        qpos: Floats,
        share: float | None = None,
        squeeze: float | None = None,
        pace: float = 1.0,
    ) -> Floats:
        """Return the action numbers, arm joints slowed alike so that they arrive together.

        Args:
            goal: Arm joints to reach, in the descriptor's order (rad).
            gripper: Action number of the gripper, if there is one.
            qpos: All joints now, in the descriptor's order, (dof,) (rad, m).
            share: Instead of ``gripper``, how far it is to be open, from 0 to 1.
            squeeze: Instead of both, the force with which its fingers are to close (N).
            pace: Share of their greatest speed at which joints move.
        """
        goals = dict(zip(self._arm_joints, goal, strict=True))
        if squeeze is not None:
            share = self._squeezing(squeeze, qpos)
        if share is not None:
            motion = gripper_motion(self._descriptor)
            goals.update(zip(motion.joints, motion.positions(share), strict=True))
        parts: list[Floats] = []
        for name, group in self._groups.items():
            if group.held or (is_gripper(name) and share is None):
                parts.append(np.full(group.size, gripper))
            elif group.mimic:
                parts.append(self._opening(group, goals))
            else:
                slower = self._gain(group) / GAIN if squeeze is not None else 1.0
                parts.append(self._towards(group, goals, qpos, pace * slower))
        return np.concatenate(parts)

    def _gain(self, group: JointGroup) -> Floats:
        """Return the factor on each joint's error with which its drive does not overshoot."""
        stiffness, damping = np.array(group.stiffness), np.maximum(group.damping, _LEAST_DAMPING)
        follows = 1 - np.exp(-self._seconds * stiffness / damping)
        return 1 / np.maximum(follows, 1 / GAIN)

    @property
    def quickness(self) -> float:
        """How fast an arm sets off towards where it is driven, as its slowest joint does (1/s)."""
        rates = {
            joint: rate
            for group in self._groups.values()
            for joint, rate in zip(group.joints, self._rates(group), strict=True)
        }
        return PEAK * max(min(rates[joint] for joint in self._arm_joints), _LEAST_DAMPING)

    def _rates(self, group: JointGroup) -> Floats:
        """Return how fast each joint's drive sets off, (joints,) (rad/s per rad still to go)."""
        damping = np.maximum(group.damping, _LEAST_DAMPING)
        return np.broadcast_to(self._gain(group) * group.stiffness / damping, len(group.joints))

    def _squeezing(self, force: float, qpos: Floats) -> float:
        """Return the share towards which the gripper presses with a force, by its drives."""
        motion = gripper_motion(self._descriptor)
        now = motion.share_at(qpos[[self._place[joint] for joint in motion.joints]])
        return now - motion.pressing(force, now)

    def _opening(self, group: JointGroup, goals: Mapping[str, float]) -> Floats:
        """Return the one number of a group that brings its first joint to its goal."""
        (low, high), (times, plus) = group.ranges[0], group.followers[0]
        value = (goals[group.joints[0]] - plus) / times
        return np.clip([(2 * value - high - low) / (high - low)], -1.0, 1.0)

    def _towards(
        self, group: JointGroup, goals: Mapping[str, float], qpos: Floats, most: Floats | float
    ) -> Floats:
        """Return a group's numbers, the largest of which are as large as asked for."""
        target = np.array([goals[joint] for joint in group.joints])
        low, high = np.array(group.ranges).T
        if not group.delta:
            return (2 * target - high - low) / (high - low)
        error = target - qpos[[self._place[joint] for joint in group.joints]]
        numbers = (2 * self._gain(group) * error - high - low) / (high - low)
        return numbers / max(1.0, (np.abs(numbers) / most).max())
