"""Inverse kinematics of grippers whose TCP link does not say where they point and how they open.

Poses are of the gripper's frame (`robots.gripper_motion`). The TCP may be the mean of several
links, such as jaws' tips, and the arm may have too few joints to turn its gripper in any way.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import pi, remainder

import numpy as np

from robot_layouts.experts.geometry import heading
from robot_layouts.experts.grips import role_grip
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    multiply,
    quaternion_of,
    rotate,
    rotation_of,
)
from robot_layouts.kinematics.solve import descend_by_differences
from robot_layouts.simulation.backend import PointSolver, PoseSolver
from robots import RobotDescriptor
from robots.descriptor import IDENTITY
from robots.gripper_motion import gripper_tree, gripper_turn, tips
from tasks import TaskEnv

_TURN_WORTH = 0.01  # m of error that a turn by 1 rad is worth: place comes first
_PLACE, _TURN = 0.003, 0.35  # m and rad that may be missing
_AXES = np.eye(3)[1:]  # how it opens, and its approach
_JOINTS = 6  # of an arm that can turn its gripper in any way


class TipSolver:
    """Finds arm joints that bring a gripper to a pose, or near it where its joints are too few.

    The place is reached, and the gripper is turned as well as can be.
    """

    def __init__(
        self,
        robot: RobotDescriptor,
        reach: PointSolver,
        turned: Floats,
        base: Floats,
        held: Floats | None = None,
    ) -> None:
        """Take a robot.

        Args:
            robot: What it is.
            reach: Its solver for points of its TCP link.
            turned: See `gripper_turn`.
            base: Where it stands, (3,) (m, world).
            held: What is brought to a place instead of the TCP, in the TCP link's frame, (3,) (m).
        """
        self._held = held
        self._robot, self._reach, self._base = robot, reach, base
        self._axes = rotate(turned, _AXES)
        self._tree = gripper_tree(robot)
        places = [robot.joints.index(joint) for joint in reach.joints]
        self._low, self._high = self._tree.limits[places].T

    def solve(self, position: Floats, quaternion: Floats, qpos: Floats) -> Floats | None:
        """Return the first of `solutions`, or None if there are none."""
        return next(iter(self.solutions(position, quaternion, qpos)), None)

    def solutions(self, position: Floats, quaternion: Floats, qpos: Floats) -> list[Floats]:
        """Return arm joints, (arm joints,) (rad); none if the pose is out of reach, else one.

        Args:
            position: Of the TCP in the world (m).
            quaternion: Of the gripper's frame in the world, wxyz.
            qpos: All joints now, in the descriptor's order, (dof,) (rad, m).
        """
        arm, tip = self._reach.arm(qpos), np.array(self._robot.tcp_offset, float)
        if self._held is not None:
            tip = self._held
        elif self._robot.tcp_position_links:
            tip = tips(self._tree, self._robot, qpos).mean(0)
        found = (
            self._near(start, tip, position, quaternion)
            for start in self._starts(arm, tip, position)
        )
        return [*islice((arm for arm in found if arm is not None), 1)]

    def _starts(self, arm: Floats, tip: Floats, position: Floats) -> Iterator[Floats]:
        """Yield postures to begin from: the arm's, and those turned to a place about its base."""
        yield arm
        now = heading(self._base, self._reach.place_of(tip, arm))
        about = remainder(heading(self._base, position) - now, 2 * pi)
        for side in (1, -1):
            yield arm + side * about * (np.arange(len(arm)) == 0)

    def _near(
        self, start: Floats, tip: Floats, position: Floats, quaternion: Floats
    ) -> Floats | None:
        axes = rotate(quaternion, _AXES)

        def errors(joints: Floats) -> Floats:
            origin, link = self._reach.forward(joints)
            turned = rotation_of(link)
            turns = _TURN_WORTH * (self._axes @ turned.T - axes)
            return np.concatenate([origin + turned @ tip - position, turns.ravel()])

        def fits(joints: Floats) -> bool:
            missing = np.abs(errors(joints))
            return bool(missing[:3].max() < _PLACE and missing[3:].max() < _TURN * _TURN_WORTH)

        near = self._reach.solve(tip, position, start)
        begun = start if near is None else near
        free, limits = range(len(start)), np.stack([self._low, self._high], axis=1)
        found = descend_by_differences(errors, begun, free)
        bounded = np.clip(found, *limits.T)
        if not fits(bounded) and (bounded != found).any():  # the other joints make up for those
            bounded = descend_by_differences(errors, bounded, free, limits)
        return bounded if fits(bounded) else None


class TurnedSolver:
    """Finds arm joints that bring a gripper to a pose whose TCP link is turned otherwise."""

    def __init__(self, solver: PoseSolver, turned: Floats, held: Floats) -> None:
        """Take a robot.

        Args:
            solver: For poses of its TCP.
            turned: See `gripper_turn`.
            held: What is brought to a place instead of the TCP, from there, in the TCP link's
                frame, (3,) (m).
        """
        self._solver, self._back, self._held = solver, inverse(turned), held

    def solve(self, position: Floats, quaternion: Floats, qpos: Floats) -> Floats | None:
        """Return arm joints near all joints ``qpos``, or None; see `TipSolver.solutions`."""
        return self._solver.solve(*self._tcp(position, quaternion), qpos)

    def solutions(self, position: Floats, quaternion: Floats, qpos: Floats) -> list[Floats]:
        """Return all that were found, the one with the shortest way first."""
        return self._solver.solutions(*self._tcp(position, quaternion), qpos)

    def _tcp(self, position: Floats, quaternion: Floats) -> tuple[Floats, Floats]:
        link = multiply(quaternion, self._back)
        return position - rotate(link, self._held), link


def pose_solver(task: TaskEnv, robot: str) -> PoseSolver | TipSolver | TurnedSolver:
    """Return what finds arm joints for poses of a robot's gripper, whatever its TCP is.

    Args:
        task: Where it stands.
        robot: Its name in the layout.
    """
    arm, backend = task.layout.arm(robot), task.simulation.backend
    descriptor, turned, held = arm.robot, gripper_turn(arm.robot), None
    if (grip := role_grip(task, robot)) is not None:
        turned, held = quaternion_of(grip.pose[:3, :3]), grip.pose[:3, 3]
    few = len(descriptor.arm_joints) < _JOINTS
    if few or (turned is not None and descriptor.tcp_position_links):
        base, turn = np.array(arm.base_position), IDENTITY if turned is None else turned
        reach = backend.point_reach(robot)
        return TipSolver(descriptor, reach, np.array(turn), base, held)
    solver = backend.inverse_kinematics(robot)
    if turned is None:
        return solver
    return TurnedSolver(
        solver, turned, np.zeros(3) if held is None else held - descriptor.tcp_offset
    )
