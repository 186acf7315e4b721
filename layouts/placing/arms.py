"""What one arm gets to, from a base anywhere: sampled once for each model, then solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from layouts.placement import Placement
from layouts.validation.reach import arm_starts, sampled_poses
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform
from robot_layouts.kinematics.solve import Goal, Solutions, solve
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel
from robots.descriptor import IDENTITY
from robots.urdf.tcp import find_tcp

RADIAN = 0.25  # m; a turn of 1 rad counts like a way of this length
DENSE = 4  # sampled postures near a place that show it to be well within reach
SPARSE = 0.2  # m; between neighbours of poses that were sampled, turns included
NEAR = 0.08  # m; the same of places


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot that is one arm, or a limb of one, wherever its base stands.

    Attributes:
        name: Its full name in the layout.
        owner: The robot that it belongs to.
        robot: That robot's descriptor.
        own: The arm, described like a robot.
        model: The robot's links and hulls.
        home: A placement of the robot, from whose keyframe its other joints are.
    """

    name: str
    owner: str
    robot: RobotDescriptor
    own: RobotDescriptor
    model: RobotModel
    home: Placement

    @cached_property
    def joints(self) -> list[int]:
        """Indices of its joints among the robot's."""
        return [self.robot.joints.index(joint) for joint in self.own.arm_joints]

    @cached_property
    def starts(self) -> Floats:
        """Joint positions that inverse kinematics starts from, (n, dof) (rad, m)."""
        return arm_starts(self.robot, self.home, self.model, self.joints)

    def beyond(self, bases: Floats, target: tuple[float, ...]) -> Floats:
        """Return about how far a target is beyond reach (m), turns included; 0 where it is not.

        By the nearest of some sampled poses, so that what is well within reach stands out.

        Args:
            bases: Poses of the base, (n, 4, 4).
            target: Place of the TCP in the world, perhaps with its wxyz orientation.
        """
        local = _local(bases, target)
        if len(target) == 3:
            distances, _ = self._places.query(local[:, :3, 3], k=DENSE)
            return np.maximum(distances[:, -1] - NEAR, 0.0)
        distances, _ = self._poses.query(_features(local[:, :3, 3], local[:, :3, :3]), k=2)
        return np.maximum(distances[:, -1] - SPARSE, 0.0)

    def solve(
        self, base: Floats, targets: Sequence[tuple[float, ...]], starts: Floats, iterations: int
    ) -> Solutions:
        """Bring the TCP to targets, from several postures each.

        Args:
            base: Pose of the base, (4, 4).
            targets: All with an orientation, or all without.
            starts: Joint positions, (targets, n, dof) (rad, m).
            iterations: How many steps to take at most.

        Returns:
            What came of them, in rows target by target.
        """
        tcp, count = find_tcp(self.own, self.model.kinematics), starts.shape[1]
        local = np.concatenate([_local(base[None], target) for target in targets])
        local = np.repeat(local, count, axis=0)
        goal = Goal(
            local[:, :3, 3],
            tcp.links,
            local[:, :3, :3] if len(targets[0]) == 7 else None,
            tcp.turned,
            tcp.offset if tcp.offset.any() else None,
        )
        rows = starts.reshape(-1, starts.shape[-1])
        return solve(self.model.kinematics, goal, rows, self.joints, iterations)

    @cached_property
    def points(self) -> Floats:
        """Where its TCP gets to in the base's frame, (n, 3) (m)."""
        return sampled_poses(self.robot, self.model, self.own)[0]

    @cached_property
    def _places(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(self.points)

    @cached_property
    def _poses(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(_features(*sampled_poses(self.robot, self.model, self.own)))


def _features(places: Floats, rotations: Floats) -> Floats:
    """Return poses as points whose distances count ways and turns, (n, 12) (m)."""
    turns = rotations.reshape(-1, 9) * (RADIAN / np.sqrt(2))
    return np.concatenate([places, turns], axis=1)


def _local(bases: Floats, target: tuple[float, ...]) -> Floats:
    """Return a target in the frames of some bases, (n, 4, 4)."""
    pose = pose_matrix(np.array(target[:3]), np.array(target[3:] or IDENTITY))
    return np.linalg.inv(bases) @ pose


def unique_points(points: Floats, size: float) -> Floats:
    """Return the middles of the cubes of some size (m) that points lie in, (n, 3)."""
    cells: Floats = np.unique(np.floor(points / size), axis=0)
    return (cells + 0.5) * size


def corners_of(model: RobotModel, qpos: Floats) -> Floats:
    """Return the corners of a robot's hulls in its base's frame, (n, 3) (m).

    Args:
        model: Its links and hulls.
        qpos: Joint positions, (dof,) (rad, m).
    """
    links = model.kinematics.forward(qpos[None])[0]
    return np.concatenate([transform(links[hull.link], hull.corners) for hull in model.hulls])
