"""Inverse kinematics of grippers whose TCP link does not say where they point and how they open.

Poses are of the gripper's frame (`robots.gripper_motion`). The TCP may be the mean of several
links, such as jaws' tips.
"""

from __future__ import annotations

import numpy as np

from robot_layouts.kinematics.rotations import Floats, inverse, multiply, rotate
from robot_layouts.kinematics.solve import descend_by_differences
from robot_layouts.simulation.backend import PointSolver, PoseSolver
from robots import RobotDescriptor
from robots.gripper_motion import gripper_tree, gripper_turn, tips
from tasks import TaskEnv

_TURN_WORTH = 0.01  # m of error that a turn by 1 rad is worth: place comes first
_PLACE, _TURN = 0.003, 0.35  # m and rad that may be missing
_AXES = np.eye(3)[1:]  # how it opens, and its approach


class TipSolver:
    """Finds arm joints that bring a gripper to a pose, or near it where its joints are too few.

    The place is reached, and the gripper is turned as well as can be.
    """

    def __init__(self, robot: RobotDescriptor, reach: PointSolver, turned: Floats) -> None:
        """Take a robot.

        Args:
            robot: What it is; its TCP is the mean of several links.
            reach: Its solver for points of its TCP link.
            turned: See `gripper_turn`.
        """
        self._robot, self._reach, self._turn = robot, reach, turned
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
        tip, arm = tips(self._tree, self._robot, qpos).mean(0), self._reach.arm(qpos)
        axes = [rotate(quaternion, axis) for axis in _AXES]

        def errors(joints: Floats) -> Floats:
            _, link = self._reach.forward(joints)
            turned = multiply(link, self._turn)
            away = self._reach.place_of(tip, joints) - position
            turns = [
                rotate(turned, axis) - wanted for axis, wanted in zip(_AXES, axes, strict=True)
            ]
            return np.concatenate([away, *(_TURN_WORTH * turn for turn in turns)])

        near = self._reach.solve(tip, position, arm)
        found = descend_by_differences(errors, arm if near is None else near, range(len(arm)))
        found = np.clip(found, self._low, self._high)
        missing = np.abs(errors(found))
        fits = missing[:3].max() < _PLACE and missing[3:].max() < _TURN * _TURN_WORTH
        return [found] if fits else []


class TurnedSolver:
    """Finds arm joints that bring a gripper to a pose whose TCP link is turned otherwise."""

    def __init__(self, solver: PoseSolver, turned: Floats) -> None:
        """Take a solver for poses of the TCP link, and see `gripper_turn`."""
        self._solver, self._back = solver, inverse(turned)

    def solve(self, position: Floats, quaternion: Floats, qpos: Floats) -> Floats | None:
        """Return arm joints near all joints ``qpos``, or None; see `TipSolver.solutions`."""
        return self._solver.solve(position, multiply(quaternion, self._back), qpos)

    def solutions(self, position: Floats, quaternion: Floats, qpos: Floats) -> list[Floats]:
        """Return all that were found, the one with the shortest way first."""
        return self._solver.solutions(position, multiply(quaternion, self._back), qpos)


def pose_solver(task: TaskEnv, robot: str) -> PoseSolver | TipSolver | TurnedSolver:
    """Return what finds arm joints for poses of a robot's gripper, whatever its TCP is.

    Args:
        task: Where it stands.
        robot: Its name in the layout.
    """
    descriptor = task.layout.arm(robot).robot
    turned = gripper_turn(descriptor)
    if turned is None or not descriptor.tcp_position_links:
        solver = task.simulation.backend.inverse_kinematics(robot)
        return solver if turned is None else TurnedSolver(solver, turned)
    return TipSolver(descriptor, task.simulation.backend.point_reach(robot), turned)
