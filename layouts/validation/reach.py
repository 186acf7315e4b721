"""What an arm's tool centre point can reach: targets, and how much space."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from layouts.arrangement import Arrangement
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.kinematics.solve import ITERATIONS, IkGoal, Solutions, scattered, solve
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel
from robots.descriptor import IDENTITY
from robots.urdf.tcp import find_tcp

STARTS = 24  # joint positions that inverse kinematics starts from, besides the keyframes
WORKSPACE_SAMPLES = 20_000  # joint positions
VOXEL = 0.1  # m
RADIAN = 0.25  # m; a turn of 1 rad counts like this distance
DENSE = 4  # sampled postures near a place that show it to be well within reach
PLACE_SPACING = 0.08  # m; between places that were sampled
POSE_SPACING = 0.2  # m; the same of poses, turns included


class Arm:
    """A robot that is one arm, or a limb of a robot, wherever its base stands.

    Joints outside the arm stay at the placement's keyframe.

    Attributes:
        name: Its full name in the layout.
        owner: The robot that it belongs to.
        placement: That robot's placement.
        own: The arm, described like a robot.
        model: The robot's links and hulls.
        joints: Indices of the arm's joints among the robot's.
    """

    def __init__(self, layout: Arrangement, name: str, model: RobotModel) -> None:
        """Take an arm of a layout.

        Args:
            layout: The layout.
            name: Full name of the arm.
            model: The links and hulls of its robot.
        """
        self.name, self.owner, self.model = name, layout.owner(name), model
        self.placement, self.own = layout[self.owner], layout.arm(name).robot
        robot = self.placement.robot
        self.joints = [robot.joints.index(joint) for joint in self.own.arm_joints]

    @cached_property
    def base(self) -> Floats:
        """Pose of the robot's base in the world, (4, 4) (m)."""
        pose = self.placement.base_pose
        return pose_matrix(pose.position, pose.quaternion)

    @cached_property
    def starts(self) -> Floats:
        """Joint positions that inverse kinematics starts from, (n, dof) (rad, m)."""
        start, joints = np.array(self.placement.start_qpos), self.joints
        limits = self.model.kinematics.limits[joints]
        keyframes = np.array([start, *self.placement.robot.keyframes.values()])
        qpos = np.tile(start, (len(keyframes) + STARTS, 1))
        qpos[: len(keyframes), joints] = keyframes[:, joints]
        qpos[len(keyframes) :, joints] = scattered(limits, STARTS)
        qpos[:, joints] = np.clip(qpos[:, joints], limits[:, 0], limits[:, 1])
        return qpos

    def solve(
        self,
        targets: Sequence[tuple[float, ...]],
        *,
        base: Floats | None = None,
        starts: Floats | None = None,
        iterations: int = ITERATIONS,
    ) -> Solutions:
        """Bring the TCP to targets by inverse kinematics, from several joint positions each.

        Args:
            targets: Places of the TCP in the world (m), all with the TCP link's wxyz orientation
                or all without.
            base: Pose of the robot's base in the world, (4, 4) (m); by default the placement's.
            starts: Joint positions for each target, (targets, n, dof) (rad, m); by default
                `starts`.
            iterations: How many steps to take at most.

        Returns:
            The solutions, in rows target by target.

        Raises:
            UnknownNameError: If the robot has no such TCP links.
        """
        base = self.base if base is None else base
        if starts is None:
            starts = np.stack([self.starts] * len(targets))
        tcp = find_tcp(self.own, self.model.kinematics)
        local = np.stack([_local(base, target) for target in targets])
        local = np.repeat(local, starts.shape[1], axis=0)
        goal = IkGoal(
            local[:, :3, 3],
            tcp.links,
            local[:, :3, :3] if len(targets[0]) == 7 else None,
            tcp.turned,
            tcp.offset if tcp.offset.any() else None,
        )
        rows = starts.reshape(-1, starts.shape[-1])
        return solve(self.model.kinematics, goal, rows, self.joints, iterations)

    def beyond(self, bases: Floats, target: tuple[float, ...]) -> Floats:
        """Return about how far a target is beyond reach (m), turns included; 0 where it is not.

        By the nearest of the sampled poses, so that what is well within reach stands out.

        Args:
            bases: Poses of the base, (n, 4, 4).
            target: Place of the TCP in the world, perhaps with its wxyz orientation.
        """
        local = _local(bases, target)
        if len(target) == 3:
            distances, _ = self._places.query(local[:, :3, 3], k=DENSE)
            return np.maximum(distances[:, -1] - PLACE_SPACING, 0.0)
        distances, _ = self._poses.query(_features(local[:, :3, 3], local[:, :3, :3]), k=2)
        return np.maximum(distances[:, -1] - POSE_SPACING, 0.0)

    @property
    def sampled_poses(self) -> tuple[Floats, Floats]:
        """Where random joint positions bring the TCP, in the base's frame.

        Places, (`WORKSPACE_SAMPLES`, 3) (m), and the TCP link's orientations, (…, 3, 3).
        """
        return _sampled_poses(self.placement.robot, self.model, self.own)

    @cached_property
    def _places(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(self.sampled_poses[0])

    @cached_property
    def _poses(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(_features(*self.sampled_poses))


class Workspace:
    """Which cells of a grid in the world an arm's tool centre point gets into.

    Found by forward kinematics of `WORKSPACE_SAMPLES` random joint positions within the limits;
    collisions are not looked at. Cells are cubes of `VOXEL`.

    Attributes:
        cells: Their whole-number places, as keys.
        volume: Of all cells (m³).
        sampled: Whether the samples were dense enough to tell; not for a robot that slides for
            many metres.
    """

    def __init__(self, arm: Arm, base: Floats) -> None:
        """Sample the workspace of an arm whose robot's base is at a pose, (4, 4) (m)."""
        points, _ = arm.sampled_poses
        cells = np.floor((points @ base[:3, :3].T + base[:3, 3]) / VOXEL).astype(np.int64)
        self.cells = np.unique(cells @ np.array([1 << 40, 1 << 20, 1]))
        self.volume = len(self.cells) * VOXEL**3
        self.sampled = len(self.cells) < len(points) / 2

    def shared_with(self, other: Workspace) -> float:
        """Return the volume of the cells that both get into (m³)."""
        return len(np.intersect1d(self.cells, other.cells, assume_unique=True)) * VOXEL**3


@lru_cache(maxsize=64)
def _sampled_poses(
    robot: RobotDescriptor, model: RobotModel, own: RobotDescriptor
) -> tuple[Floats, Floats]:
    arm = [robot.joints.index(joint) for joint in own.arm_joints]
    qpos = np.tile(np.array(robot.keyframe(robot.home.keyframe)), (WORKSPACE_SAMPLES, 1))
    qpos[:, arm] = scattered(model.kinematics.limits[arm], WORKSPACE_SAMPLES)
    tree = model.kinematics.towards(find_tcp(own, model.kinematics).needed)
    tcp, poses = find_tcp(own, tree), tree.forward(qpos)
    return tcp.places(poses), poses[:, tcp.turned, :3, :3].copy()


def _features(places: Floats, rotations: Floats) -> Floats:
    """Return poses as points whose distances count shifts and turns, (n, 12) (m)."""
    turns = rotations.reshape(-1, 9) * (RADIAN / np.sqrt(2))
    return np.concatenate([places, turns], axis=1)


def _local(bases: Floats, target: tuple[float, ...]) -> Floats:
    """Return a target in the frames of some bases, (…, 4, 4)."""
    pose = pose_matrix(np.array(target[:3]), np.array(target[3:] or IDENTITY))
    return np.linalg.inv(bases) @ pose
