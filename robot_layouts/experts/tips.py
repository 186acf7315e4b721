"""Robots whose tool centre point is no link, but the mean of several, such as jaws' tips.

Such a gripper has no frame of its own that says where it points and how it opens, so that one is
worked out here: z is its approach and y the way its tips part, as `gripper_facing` has them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from robot_layouts.kinematics.rotations import Floats, inverse_pose, multiply, quaternion_of, rotate
from robot_layouts.kinematics.solve import descend_by_differences
from robot_layouts.kinematics.tree import Tree
from robot_layouts.simulation.backend import PointSolver, PoseSolver
from robots import RobotDescriptor
from robots.action_split import is_gripper
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree
from tasks import TaskEnv

_TURN_WORTH = 0.01  # m of error that a turn by 1 rad is worth: place comes first
_PLACE, _TURN = 0.003, 0.35  # m and rad that may be missing
_AXES = np.eye(3)[1:]  # how it opens, and its approach
_SHORT = 1e-4  # m; shorter ways have no direction
_POSTURES = 9  # of the gripper between its limits, of which the most closed and the next count


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
        self._tree = link_tree(robot)
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
        tip, arm = _tips(self._tree, self._robot, qpos).mean(0), self._reach.arm(qpos)
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


def pose_solver(task: TaskEnv, robot: str) -> PoseSolver | TipSolver:
    """Return what finds arm joints for poses of a robot's gripper, whatever its TCP is.

    Args:
        task: Where it stands.
        robot: Its name in the layout.
    """
    descriptor = task.layout.arm(robot).robot
    turned = gripper_turn(descriptor)
    if turned is None:
        return task.simulation.backend.inverse_kinematics(robot)
    return TipSolver(descriptor, task.simulation.backend.point_reach(robot), turned)


@lru_cache(maxsize=64)
def gripper_turn(robot: RobotDescriptor) -> Floats | None:
    """Return what turns the TCP link into the gripper's frame, wxyz.

    None if the TCP is a link, or its tips do not say how the gripper opens.

    Args:
        robot: Whose gripper.

    Raises:
        AssetError: If its files cannot be found.
    """
    if not robot.tcp_position_links:
        return None
    tree, qpos = link_tree(robot), np.array(robot.keyframe(robot.home.keyframe), float)
    places = [
        robot.joints.index(joint)
        for name, group in robot.action_split.groups.items()
        if is_gripper(name)
        for joint in group.joints
    ]
    low, high = tree.limits[places].T
    postures: list[Floats] = []
    for share in np.linspace(0, 1, _POSTURES):
        qpos[places] = low + share * (high - low)
        postures.append(_tips(tree, robot, qpos))
    shut, ajar, *_ = sorted(postures, key=_gap)
    approach, apart = _unit(shut.mean(0)), ajar[-1] - ajar[0]
    opening = _unit(apart - apart @ approach * approach)
    if not (approach.any() and opening.any()):
        return None
    return quaternion_of(np.stack([np.cross(opening, approach), opening, approach], 1))


@lru_cache(maxsize=64)
def link_tree(robot: RobotDescriptor) -> Tree:
    """Return the tree of a robot's links; its coordinates are the descriptor's joints.

    Raises:
        AssetError: If its files cannot be found.
    """
    urdf = robot.urdf.locate()
    return kinematic_tree(read_model(read_urdf(urdf), urdf.as_posix()), robot.joints)


def _tips(tree: Tree, robot: RobotDescriptor, qpos: Floats) -> Floats:
    """Return the links whose mean is the TCP in the frame of the TCP link, (links, 3) (m)."""
    poses = tree.forward(qpos[None])[0]
    link = inverse_pose(poses[tree.link(robot.tcp_link)])
    return np.array([(link @ poses[tree.link(tip)])[:3, 3] for tip in robot.tcp_position_links])


def _gap(tips: Floats) -> float:
    return float(np.linalg.norm(tips[-1] - tips[0]))


def _unit(vector: Floats) -> Floats:
    """Return a vector of length 1; of length 0 if it has hardly any."""
    length = np.linalg.norm(vector)
    return vector / length if length > _SHORT else np.zeros(3)
