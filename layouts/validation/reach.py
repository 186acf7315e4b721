"""What a placed robot's tool centre point can reach: targets, and how much space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from layouts import Placement
from layouts.validation.bodies import RobotModel
from layouts.validation.kinematics import Floats, pose_matrix
from robots import RobotDescriptor
from robots.descriptor import IDENTITY

STARTS = 24  # places that inverse kinematics starts from, besides the keyframes
ITERATIONS = 80
DAMPING = 0.03  # m and rad; keeps steps small near singular postures
LONGEST_STEP = 0.4  # of a joint, per iteration (rad or m)
NEAR_ENOUGH = 1e-3, 1e-2  # m and rad
SEED = 0  # starts and workspace samples are the same for every request

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
    """Inverse kinematics of one placed robot, by damped least squares from many starts.

    Joints outside the arm stay at the placement's keyframe.
    """

    def __init__(self, placement: Placement, model: RobotModel) -> None:
        """Take a robot.

        Args:
            placement: Where it stands.
            model: Its links.

        Raises:
            UnknownNameError: If the robot has no such TCP links.
        """
        robot = placement.robot
        self._kinematics = model.kinematics
        self._base = pose_matrix(placement.base_position, placement.base_quaternion)
        self._start = np.array(placement.start_qpos)
        self._arm = [robot.joints.index(joint) for joint in robot.arm_joints]
        self._tcp = model.kinematics.link(robot.tcp_link)
        self._points = tcp_links(robot, model)
        self._starts = _starts(robot, placement, model, self._arm)

    def solve(self, position: Floats, quaternion: Floats | None = None) -> list[Solution]:
        """Return the solutions for a target, the nearest to the keyframe first.

        If there is none, the list holds the one posture that comes nearest.

        Args:
            position: Of the tool centre point in the world, (3,) (m).
            quaternion: Of the TCP link in the world, wxyz, or None if any will do.
        """
        turns = quaternion is not None
        pose = pose_matrix(position.tolist(), quaternion.tolist() if turns else IDENTITY)
        target = np.linalg.inv(self._base) @ pose
        qpos = self._descend(target, turns)
        errors, _ = self._errors(qpos, target, turns)
        missing = np.linalg.norm(errors[:, :3], axis=1)
        turn_missing = np.linalg.norm(errors[:, 3:], axis=1)
        solved = (missing < NEAR_ENOUGH[0]) & (turn_missing < NEAR_ENOUGH[1])
        way = np.abs(qpos - self._start).max(axis=1)
        order = np.argsort(way)[solved[np.argsort(way)]]
        if not len(order):
            order = [np.argmin(missing + turn_missing)]
        return [
            Solution(
                tuple(qpos[i].tolist()), float(missing[i]), float(turn_missing[i]), bool(solved[i])
            )
            for i in order
        ]

    def _descend(self, target: Floats, turns: bool) -> Floats:
        qpos, limits = self._starts.copy(), self._kinematics.limits[self._arm]
        rows = 6 if turns else 3
        damping = DAMPING**2 * np.eye(rows)
        for _ in range(ITERATIONS):
            errors, slopes = self._errors(qpos, target, turns)
            if (np.abs(errors).max(axis=1) < NEAR_ENOUGH[0] / 10).all():
                break
            # A joint at a limit that it is drawn beyond leaves the way to the others.
            at, pull = qpos[:, self._arm], (errors[:, None] @ slopes)[:, 0]
            stuck = ((at <= limits[:, 0]) & (pull < 0)) | ((at >= limits[:, 1]) & (pull > 0))
            slopes = np.where(stuck[:, None], 0.0, slopes)
            # The damping vanishes with the error, so that the last steps are whole ones.
            scale = np.minimum(1.0, np.linalg.norm(errors, axis=1) * 10)[:, None, None]
            normal = slopes @ slopes.transpose(0, 2, 1) + scale * damping + 1e-9 * np.eye(rows)
            step = slopes.transpose(0, 2, 1) @ np.linalg.solve(normal, errors[:, :, None])
            moved = at + np.clip(step[:, :, 0], -LONGEST_STEP, LONGEST_STEP)
            qpos[:, self._arm] = np.clip(moved, limits[:, 0], limits[:, 1])
        return qpos

    def _errors(self, qpos: Floats, target: Floats, turns: bool) -> tuple[Floats, Floats]:
        """Return what is missing to the target, (n, 3 or 6), and its slopes by the arm's joints."""
        poses = self._kinematics.forward(qpos)
        place = poses[:, self._points][..., :3, 3].mean(axis=1)
        errors, slopes = target[:3, 3] - place, np.zeros((len(qpos), 3, len(self._arm)))
        for link in self._points:
            turning, sliding = self._kinematics.axes(poses, link, self._arm)
            velocity = sliding + np.cross(turning, poses[:, link, None, :3, 3])
            slopes += velocity.transpose(0, 2, 1) / len(self._points)
        if not turns:
            return errors, slopes
        turning, _ = self._kinematics.axes(poses, self._tcp, self._arm)
        turn = rotation_vectors(target[:3, :3] @ poses[:, self._tcp, :3, :3].transpose(0, 2, 1))
        return (
            np.concatenate([errors, turn], axis=1),
            np.concatenate([slopes, turning.transpose(0, 2, 1)], axis=1),
        )


def rotation_vectors(rotations: Floats) -> Floats:
    """Return axis times angle (rad) of rotation matrices: (n, 3, 3) to (n, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotations).as_rotvec()


def tcp_links(robot: RobotDescriptor, model: RobotModel) -> list[int]:
    """Return the links whose mean origin is the tool centre point.

    Raises:
        UnknownNameError: If the robot lacks one of them.
    """
    return [model.kinematics.link(n) for n in robot.tcp_position_links or (robot.tcp_link,)]


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

    def __init__(self, placement: Placement, model: RobotModel) -> None:
        """Sample the workspace of a placed robot."""
        base = pose_matrix(placement.base_position, placement.base_quaternion)
        points = _workspace_points(placement.robot, model)
        cells = np.floor((points @ base[:3, :3].T + base[:3, 3]) / VOXEL).astype(np.int64)
        self.cells = np.unique(cells @ np.array([1 << 40, 1 << 20, 1]))
        self.volume = len(self.cells) * VOXEL**3
        self.sampled = len(self.cells) < len(points) / 2

    def shared_with(self, other: Workspace) -> float:
        """Return the volume of the cells that both get into (m³)."""
        return len(np.intersect1d(self.cells, other.cells, assume_unique=True)) * VOXEL**3


@lru_cache(maxsize=64)
def _workspace_points(robot: RobotDescriptor, model: RobotModel) -> Floats:
    arm = [robot.joints.index(joint) for joint in robot.arm_joints]
    start = np.array(robot.keyframe(robot.home.keyframe))
    qpos = np.tile(start, (WORKSPACE_SAMPLES, 1))
    qpos[:, arm] = _within_limits(model, arm)(WORKSPACE_SAMPLES)
    poses = model.kinematics.forward(qpos)
    return poses[:, tcp_links(robot, model)][..., :3, 3].mean(axis=1)


def _within_limits(model: RobotModel, joints: list[int]) -> Callable[[int], Floats]:
    """Return a function that draws so many positions of some joints, (n, joints) (rad, m)."""
    random = np.random.default_rng(SEED)
    limits = np.nan_to_num(model.kinematics.limits[joints], posinf=np.pi, neginf=-np.pi)
    return lambda count: random.uniform(limits[:, 0], limits[:, 1], (count, len(joints)))


def _starts(
    robot: RobotDescriptor, placement: Placement, model: RobotModel, arm: list[int]
) -> Floats:
    keyframes = [placement.start_qpos, *robot.keyframes.values()]
    qpos = np.tile(np.array(placement.start_qpos), (len(keyframes) + STARTS, 1))
    qpos[: len(keyframes), arm] = np.array(keyframes)[:, arm]
    qpos[len(keyframes) :, arm] = _within_limits(model, arm)(STARTS)
    limits = model.kinematics.limits[arm]
    qpos[:, arm] = np.clip(qpos[:, arm], limits[:, 0], limits[:, 1])
    return qpos
