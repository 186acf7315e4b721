"""What a placed robot's tool centre point can reach: targets, and how much space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from layouts.frames import Pose
from layouts.placement import Placement
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.kinematics.solve import Goal, scattered, solve
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel
from robots.descriptor import IDENTITY
from robots.urdf.tcp import find_tcp

STARTS = 24  # places that inverse kinematics starts from, besides the keyframes

WORKSPACE_SAMPLES = 20_000  # joint positions
VOXEL = 0.1  # m


@dataclass(frozen=True)
class Solution:
    """What inverse kinematics found for one robot and target.

    Attributes:
        qpos: Joint positions in the descriptor's order (rad, m): the solution, or the posture
            that comes nearest.
        missing: How far the tool centre point stays from the target (m).
        turn_missing: How far its orientation stays from the target's (rad); 0 if none was asked.
        solved: Whether both are as good as zero.
    """

    qpos: tuple[float, ...]
    missing: float
    turn_missing: float
    solved: bool


class Reach:
    """Inverse kinematics of one placed robot, or of a limb of it, from many starts.

    Joints outside the arm stay at the placement's keyframe.
    """

    def __init__(
        self, placement: Placement, model: RobotModel, arm: RobotDescriptor | None = None
    ) -> None:
        """Take a robot.

        Args:
            placement: Where it stands.
            model: Its links.
            arm: The limb, described like a robot; None for a robot that is one arm.

        Raises:
            UnknownNameError: If the robot has no such TCP links.
        """
        robot, arm = placement.robot, arm or placement.robot
        self._kinematics = model.kinematics
        self._base = pose_matrix(placement.base_position, placement.base_quaternion)
        self._start = np.array(placement.start_qpos)
        self._arm = [robot.joints.index(joint) for joint in arm.arm_joints]
        self._tcp = find_tcp(arm, model.kinematics)
        self._starts = arm_starts(robot, placement, model, self._arm)

    def solve(self, position: Floats, quaternion: Floats | None = None) -> list[Solution]:
        """Return the solutions for a target, the nearest to the keyframe first.

        If there is none, the list holds the one posture that comes nearest.

        Args:
            position: Of the tool centre point in the world, (3,) (m).
            quaternion: Of the TCP link in the world, wxyz, or None if any will do.
        """
        pose = pose_matrix(position, IDENTITY if quaternion is None else quaternion)
        target = np.linalg.inv(self._base) @ pose
        rotation = None if quaternion is None else target[:3, :3]
        tcp = self._tcp
        offset = tcp.offset if tcp.offset.any() else None
        goal = Goal(target[:3, 3], tcp.links, rotation, tcp.turned, offset)
        found = solve(self._kinematics, goal, self._starts, self._arm)
        return [
            Solution(
                tuple(found.qpos[i].tolist()),
                float(found.missing[i]),
                float(found.turn_missing[i]),
                bool(found.solved[i]),
            )
            for i in found.ranked(self._start)
        ]


class Workspace:
    """Which cells of a grid in the world a robot's tool centre point gets into.

    Found by forward kinematics of `WORKSPACE_SAMPLES` random joint positions within the limits;
    collisions are not looked at. Cells are cubes of `VOXEL`.

    Attributes:
        cells: Their whole-number places, as keys.
        volume: Of all cells (m³).
        sampled: Whether the samples were dense enough to tell; not for a robot that slides for
            many metres.
    """

    def __init__(
        self,
        base: Pose,
        robot: RobotDescriptor,
        model: RobotModel,
        arm: RobotDescriptor | None = None,
    ) -> None:
        """Sample the workspace of a robot with its base there; see `Reach`."""
        pose = pose_matrix(base.position, base.quaternion)
        points, _ = sampled_poses(robot, model, arm or robot)
        cells = np.floor((points @ pose[:3, :3].T + pose[:3, 3]) / VOXEL).astype(np.int64)
        self.cells = np.unique(cells @ np.array([1 << 40, 1 << 20, 1]))
        self.volume = len(self.cells) * VOXEL**3
        self.sampled = len(self.cells) < len(points) / 2

    def shared_with(self, other: Workspace) -> float:
        """Return the volume of the cells that both get into (m³)."""
        return len(np.intersect1d(self.cells, other.cells, assume_unique=True)) * VOXEL**3


@lru_cache(maxsize=64)
def sampled_poses(
    robot: RobotDescriptor, model: RobotModel, own: RobotDescriptor
) -> tuple[Floats, Floats]:
    """Return where random joint positions bring a tool centre point, in the base's frame.

    Args:
        robot: The robot.
        model: Its links.
        own: The robot again, or a limb of it, described like a robot.

    Returns:
        Places, (`WORKSPACE_SAMPLES`, 3) (m), and the TCP link's orientations, (…, 3, 3).
    """
    arm = [robot.joints.index(joint) for joint in own.arm_joints]
    start = np.array(robot.keyframe(robot.home.keyframe))
    qpos = np.tile(start, (WORKSPACE_SAMPLES, 1))
    qpos[:, arm] = scattered(model.kinematics.limits[arm], WORKSPACE_SAMPLES)
    tree = model.kinematics.towards(find_tcp(own, model.kinematics).needed)
    tcp, poses = find_tcp(own, tree), tree.forward(qpos)
    return tcp.places(poses), poses[:, tcp.turned, :3, :3].copy()


def arm_starts(
    robot: RobotDescriptor, placement: Placement, model: RobotModel, arm: list[int]
) -> Floats:
    """Return the joint positions that inverse kinematics starts from, (n, dof) (rad, m).

    Args:
        robot: The robot.
        placement: From whose keyframe the joints outside the arm are.
        model: Its links.
        arm: Indices of the arm's joints.
    """
    keyframes = [placement.start_qpos, *robot.keyframes.values()]
    qpos = np.tile(np.array(placement.start_qpos), (len(keyframes) + STARTS, 1))
    qpos[: len(keyframes), arm] = np.array(keyframes)[:, arm]
    qpos[len(keyframes) :, arm] = scattered(model.kinematics.limits[arm], STARTS)
    limits = model.kinematics.limits[arm]
    qpos[:, arm] = np.clip(qpos[:, arm], limits[:, 0], limits[:, 1])
    return qpos
