"""Approximate inverse kinematics: how near an arm gets to a pose of its TCP, the place first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.kinematics.solve import IkGoal, approach, shortfalls
from robots import JointGroup, RobotDescriptor
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree

_ROUNDS = 20
_LONGEST = 0.5  # way of a joint in a round (rad, m)
_STRIDE = 0.1  # way of the TCP in a round (m), until one brings it no nearer
_SHORTER = 0.3  # times that ever after
_NEAR_ENOUGH = 1e-4  # m; where the place is had, or no stride brings the TCP nearer
_GAIN = 1e-5, 1e-4  # m, rad; less counts as no gain
_BEYOND = 1e-3  # a limit, that a joint may be sent (rad, m)


class ApproximateArm:
    """An arm that goes as near to a pose of its TCP as it gets from where it is."""

    def __init__(self, robot: RobotDescriptor, arm: RobotDescriptor, group: JointGroup) -> None:
        """Read the robot's links.

        Args:
            robot: The robot.
            arm: The robot, or its limb whose TCP it is.
            group: The joints that may move.

        Raises:
            AssetError: If the robot's files cannot be found or read.
        """
        urdf = robot.urdf.locate()
        tree = kinematic_tree(read_model(read_urdf(urdf), urdf.as_posix()), robot.joints)
        tcp = find_tcp(arm, tree)
        root = () if group.root_link is None else (tree.link(group.root_link),)
        self._tree = needed = tree.towards([*tcp.needed, *root])
        self._root = 0 if group.root_link is None else needed.link(group.root_link)
        self._links = [needed.link(tree.links[link]) for link in tcp.links]
        self._turned, self._offset = needed.link(tree.links[tcp.turned]), tcp.offset
        self._free = [robot.joints.index(joint) for joint in group.joints]

    def nearest(self, pose: Floats, qpos: Floats) -> tuple[Floats, tuple[float, float]]:
        """Return the joints that bring the TCP nearest to a pose, and by how much it falls short.

        Args:
            pose: Of the TCP in the frame of the group's root link: position (m), then quaternion
                (wxyz), (7,).
            qpos: Where all joints of the robot are, (dof,) (rad, m).

        Returns:
            Positions of the group's joints, (joints,) (rad, m), and what is missing to the place
            (m) and to the orientation (rad).
        """
        joints = qpos
        root = self._tree.forward(joints[None])[0, self._root]
        wanted = root @ pose_matrix(pose[:3], pose[3:])
        goal = IkGoal(wanted[:3, 3], self._links, wanted[:3, :3], self._turned, self._offset)
        best, stride = self._misses(goal, joints), _STRIDE
        for _ in range(_ROUNDS):
            near = self._on_the_way(goal, joints, stride)
            moved = approach(self._tree, near, joints, self._free, _LONGEST, qpos[self._free])
            misses = self._misses(goal, moved)
            if _nearer(misses, best):
                joints, best = moved, misses
            elif min(best[0], stride) < _NEAR_ENOUGH:
                break
            else:
                stride *= _SHORTER
        return joints[self._free], best

    def _on_the_way(self, goal: IkGoal, joints: Floats, stride: float) -> IkGoal:
        """Return a goal whose place is at most a stride from where the TCP is."""
        poses = self._tree.forward(joints[None])[0]
        here = poses[self._links, :3, 3].mean(axis=0) + poses[self._turned, :3, :3] @ self._offset
        way = goal.position - here
        length = float(np.linalg.norm(way))
        return goal if length <= stride else replace(goal, position=here + way * (stride / length))

    def _misses(self, goal: IkGoal, joints: Floats) -> tuple[float, float]:
        away, turned_away = shortfalls(self._tree, goal, joints[None])
        return float(away[0]), float(turned_away[0])


def _nearer(misses: tuple[float, float], best: tuple[float, float]) -> bool:
    """Tell whether a place is missed by less, or an orientation without losing the place."""
    place, turn = best[0] - misses[0], best[1] - misses[1]
    return place > _GAIN[0] or (place > -_GAIN[0] and turn > _GAIN[1])


def nearest_turns(found: Floats, present: Floats, limits: NDArray[np.floating]) -> Floats | None:
    """Return joints by the turn that is nearest to where they are, or None beyond their limits.

    Args:
        found: Joint positions, of which joints that turn without end lie in (-π, π], (joints,).
        present: Where they are now, (joints,) (rad, m).
        limits: Their lower and upper limits, (joints, 2); infinite without an end.
    """
    low, high = limits.astype(float).T
    turns = np.where(np.isinf(high - low), np.round((present - found) / (2 * np.pi)), 0.0)
    turned = np.where(turns == 0.0, found, found + turns * 2 * np.pi)
    inside = (turned >= low - _BEYOND) & (turned <= high + _BEYOND)
    return turned if inside.all() else None
