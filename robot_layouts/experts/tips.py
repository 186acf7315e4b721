"""Grippers whose TCP link does not say where they point and how they open.

Their frame is worked out here: z is the approach and y the way the fingers part, as
`gripper_facing` has them. The TCP may be the mean of several links, such as jaws' tips.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    inverse_pose,
    multiply,
    quaternion_of,
    rotate,
)
from robot_layouts.kinematics.solve import descend_by_differences
from robot_layouts.kinematics.tree import Tree
from robot_layouts.simulation.backend import PointSolver, PoseSolver
from robots import RobotDescriptor
from robots.action_split import is_gripper
from robots.urdf.model import UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree
from tasks import TaskEnv

_TURN_WORTH = 0.01  # m of error that a turn by 1 rad is worth: place comes first
_PLACE, _TURN = 0.003, 0.35  # m and rad that may be missing
_AXES = np.eye(3)[1:]  # how it opens, and its approach
_AS_IT_IS = 0.7  # cosine; a TCP link that is turned less has the gripper's frame
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
        self._tree = _gripper_tree(robot)
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


@lru_cache(maxsize=64)
def gripper_turn(robot: RobotDescriptor) -> Floats | None:
    """Return what turns the TCP link into the gripper's frame, wxyz.

    None if the TCP link has that frame itself, or nothing says how the gripper opens.

    Args:
        robot: Whose gripper.

    Raises:
        AssetError: If its files cannot be found.
    """
    if not robot.tcp_position_links:
        return _turn_of_fingers(robot)
    tree, qpos = _gripper_tree(robot), np.array(robot.keyframe(robot.home.keyframe), float)
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
    return _turn_to(shut.mean(0), ajar[-1] - ajar[0])


def _turn_of_fingers(robot: RobotDescriptor) -> Floats | None:
    """Return the turn into the frame by which way the fingers open, seen from the wrist."""
    fingers = robot.fingers
    if fingers is None or not robot.arm_joints:
        return None
    tree = _gripper_tree(robot)
    poses = _poses(tree, np.array(robot.keyframe(robot.home.keyframe), float))
    arm = [joint.child for joint in _model(robot).ordered if joint.name in robot.arm_joints]
    tcp, wrist = find_tcp(robot, tree), max(map(tree.link, arm), key=lambda at: len(tree.path(at)))
    turn = poses[tcp.turned, :3, :3]
    one, other = (
        sign * poses[tree.link(link), :3, :3] @ axis
        for link, sign, axis in zip(
            fingers.links, fingers.opening_signs, fingers.opening_axes, strict=True
        )
    )
    ahead = (tcp.places(poses[None])[0] - poses[wrist, :3, 3]) @ turn
    opening = _unit((one - other) @ turn)
    approach = _unit(ahead - ahead @ opening * opening)
    if abs(opening[1]) > _AS_IT_IS and approach[2] > _AS_IT_IS:
        return None
    return _turn_to(approach, opening * (np.sign(opening.sum()) or 1.0))


def _turn_to(approach: Floats, apart: Floats) -> Floats | None:
    """Return the turn to a frame with an approach and a way in which the fingers part, (4,)."""
    approach = _unit(approach)
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
    return kinematic_tree(_model(robot), robot.joints)


@lru_cache(maxsize=64)
def _gripper_tree(robot: RobotDescriptor) -> Tree:
    """Return the tree of a robot's or a limb's links; joints of others follow its coordinates."""
    model = _model(robot)
    others = [j.name for j in model.moving if j.name not in robot.joints and j.mimics is None]
    return kinematic_tree(model, (*robot.joints, *others))


def _model(robot: RobotDescriptor) -> UrdfModel:
    urdf = robot.urdf.locate()
    return read_model(read_urdf(urdf), urdf.as_posix())


def _tips(tree: Tree, robot: RobotDescriptor, qpos: Floats) -> Floats:
    """Return the links whose mean is the TCP in the frame of the TCP link, (links, 3) (m)."""
    poses = _poses(tree, qpos)
    link = inverse_pose(poses[tree.link(robot.tcp_link)])
    return np.array([(link @ poses[tree.link(tip)])[:3, 3] for tip in robot.tcp_position_links])


def _poses(tree: Tree, qpos: Floats) -> Floats:
    """Return the poses of a gripper's links; joints of other limbs, at 0, move all of them."""
    return tree.forward(np.pad(qpos, (0, len(tree.coordinates) - len(qpos)))[None])[0]


def _gap(tips: Floats) -> float:
    return float(np.linalg.norm(tips[-1] - tips[0]))


def _unit(vector: Floats) -> Floats:
    """Return a vector of length 1; of length 0 if it has hardly any."""
    length = np.linalg.norm(vector)
    return vector / length if length > _SHORT else np.zeros(3)
