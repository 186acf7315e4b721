"""How a task's places and sizes fit the robots that it is made with.

A task is declared in numbers for its own robots. Other robots reach less or farther, stand
elsewhere, and hold smaller or larger things: their `Fit` says where the origin of the declaration
lies between them, how it is turned, and by which factor it is larger.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from layouts.placement import Placement
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform
from robot_layouts.kinematics.solve import scattered
from robots import DescriptorError, RobotDescriptor, TaskError
from robots.descriptor import Quaternion, Vector3
from robots.gripper_motion import gripper_frame, gripper_motion, home_of, link_tree
from robots.urdf.tcp import find_tcp

_SAMPLES = 20_000  # random joint positions per arm
_LEAST_DOWN = 0.3  # cosine between a gripper's approach and straight down
_CELL = 0.05  # of the shorter reach: edge of the cells that places are counted in
_HEIGHT = 0.35  # of the shorter reach: how high above the ground places are looked for
_OFTEN = 3  # samples in a cell and its neighbours that show it to be well within reach
_ROOM = 0.04  # m that a declaration for a Panda needs about its origin, in reach of all arms
_HELD = 0.75  # of a gripper's opening that a body to be held may take
_SPLAYED = 0.28  # rad; between jaws that are turned more a body is held by its edges, and slips out
_LARGEST, _SMALLEST = 3.0, 0.05


@dataclass(frozen=True)
class Fit:
    """Where a declaration's frame lies in the world, and how large it is there.

    Attributes:
        scale: Factor on all lengths.
        x: Of its origin (m, world).
        y: Of its origin (m, world).
        yaw: How it is turned about z (rad).
    """

    scale: float = 1.0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @property
    def as_declared(self) -> bool:
        """Whether it changes nothing."""
        return self == AS_DECLARED

    def length(self, declared: float) -> float:
        """Return a declared length as it is here (m)."""
        return declared if self.as_declared else declared * self.scale

    def place(self, declared: Vector3) -> Vector3:
        """Return a declared place as it is here (m, world)."""
        if self.as_declared:
            return declared
        x, y, z = (self.scale * along for along in declared)
        c, s = cos(self.yaw), sin(self.yaw)
        return (self.x + c * x - s * y, self.y + s * x + c * y, z)

    def turned(self, declared: Quaternion) -> Quaternion:
        """Return a declared orientation as it is here, wxyz."""
        if self.as_declared:
            return declared
        return multiplied((cos(self.yaw / 2), 0.0, 0.0, sin(self.yaw / 2)), declared)


AS_DECLARED = Fit()


def fit_to(layout: Layout, declared: Layout, held: float) -> Fit:
    """Return how a declaration fits other robots, or others' places.

    Its origin lies where all arms reach best, its y axis points from the first arm to the second,
    and it is as much larger as the arms reach farther, unless that is more than their grippers
    can hold or than there is room.

    Args:
        layout: The robots that are to do the task.
        declared: The task's own layout.
        held: Width of the widest body that they hold, as declared (m).

    Raises:
        TaskError: If no place is in reach of all arms.
        AssetError: If robot files cannot be found.
    """
    arms = [layout.arm(place) for place in declared.places]
    own = [declared.arm(place) for place in declared.places]
    if all(_alike(*pair) for pair in zip(arms, own, strict=True)):
        return AS_DECLARED
    scale = min(a.robot.reach for a in arms) / min(a.robot.reach for a in own)
    if held:
        scale = min([scale, *(_holds(arm.robot) / held for arm in arms if _opening(arm.robot))])
    (x, y), room = shared_place(layout, tuple(declared.places))
    scale = min(scale, room / _ROOM)
    (x0, y0, _), (x1, y1, _) = (arm.base_position for arm in (arms[0], arms[-1]))
    yaw = atan2(y1 - y0, x1 - x0) - np.pi / 2 if len(arms) > 1 else 0.0
    return Fit(min(max(scale, _SMALLEST), _LARGEST), x, y, yaw)


def shared_place(layout: Layout, places: tuple[str, ...]) -> tuple[tuple[float, float], float]:
    """Return the place on the ground that lies deepest within reach of all arms, and how deep (m).

    An arm reaches a place if random postures often bring its TCP there, near the ground and with
    the gripper pointing down more than it does aside.

    Args:
        layout: The robots.
        places: The arms, by their names or places.

    Raises:
        TaskError: If no place is in reach of all of them.
        AssetError: If robot files cannot be found.
    """
    reach = min(layout.arm(place).robot.reach for place in places)
    cell = _CELL * reach
    reached = [_near_ground(layout, place, _HEIGHT * reach) for place in places]
    everywhere = np.concatenate(reached) if all(map(len, reached)) else np.zeros((1, 2))
    low, high = everywhere.min(axis=0) - 2 * cell, everywhere.max(axis=0) + 2 * cell
    counts = np.ceil((high - low) / cell).astype(int)
    shared = np.ones(counts, bool)
    for points in reached:
        shared &= _often(points, low, cell, counts)
    if not shared.any():
        names = ", ".join(f"{place!r} ({layout.arm(place).robot.name})" for place in places)
        raise TaskError(
            f"no place on the ground is in reach of all of {names}, gripper down; place them nearer"
            " to each other, as layouts.face_to_face(…, spacing='auto') does"
        )
    depths = _depths(shared) * cell
    # Of equally deep places the one in the middle of all.
    deepest = np.argwhere(depths >= depths.max() - cell / 2)
    middle = deepest[np.argmin(np.abs(deepest - deepest.mean(axis=0)).sum(axis=1))]
    x, y = (low + (middle + 0.5) * cell).tolist()
    return (x, y), float(depths.max())


def _alike(arm: Placement, own: Placement) -> bool:
    """Return whether an arm stands where a task's own does, and reaches and holds as much."""
    if arm.robot == own.robot:
        return arm.base_pose == own.base_pose
    same = (arm.base_pose, arm.robot.reach) == (own.base_pose, own.robot.reach)
    return same and _opening(arm.robot) == _opening(own.robot)


def _opening(robot: RobotDescriptor) -> float | None:
    """Return how wide a gripper opens, to 0.1 mm (m); None of one that has no fingers."""
    try:
        return round(gripper_motion(robot).widest, 4)
    except DescriptorError:
        return None


def _holds(robot: RobotDescriptor) -> float:
    """Return the width of the widest body that a gripper holds well (m)."""
    motion = gripper_motion(robot)
    return min(_HELD * motion.widest, motion.widest_within(_SPLAYED))


def _near_ground(layout: Layout, place: str, height: float) -> Floats:
    """Return where postures bring a TCP that is low and points down, (n, 2) (m, world)."""
    owner = layout[layout.owner(place)]
    base = pose_matrix(owner.base_pose.position, owner.base_pose.quaternion)
    points, approaches = _postures(owner.robot, layout.arm(place).robot)
    points, approaches = transform(base, points), approaches @ base[:3, :3].T
    low = (points[:, 2] > 0) & (points[:, 2] < height) & (approaches[:, 2] < -_LEAST_DOWN)
    return points[low, :2]


@lru_cache(maxsize=32)
def _postures(robot: RobotDescriptor, arm: RobotDescriptor) -> tuple[Floats, Floats]:
    """Return places and approaches of an arm's gripper in random postures, (n, 3) each, root."""
    tree = link_tree(robot)
    columns = [robot.joints.index(joint) for joint in arm.arm_joints]
    qpos = np.tile(home_of(robot, tree), (_SAMPLES, 1))
    qpos[:, columns] = scattered(tree.limits[columns], _SAMPLES)
    tree = tree.towards(find_tcp(arm, tree).needed)
    tcp, poses = find_tcp(arm, tree), tree.forward(qpos)
    return tcp.places(poses), poses[:, tcp.turned, :3, :3] @ gripper_frame(arm)[:, 2]


def _often(points: Floats, low: Floats, cell: float, counts: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which cells hold enough points, with their neighbours."""
    found = np.zeros(counts)
    inside = np.floor((points - low) / cell).astype(int)
    np.add.at(found, tuple(inside.T), 1)
    padded = np.pad(found, 1)
    rows, columns = counts
    near = sum(padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3))
    return np.asarray(near >= _OFTEN)


def _depths(inside: NDArray[np.bool_]) -> Floats:
    """Return how far each cell is from the nearest that is not inside, in cells."""
    others, cells = np.argwhere(~inside), np.argwhere(inside)
    depths = np.zeros(inside.shape)
    for cell in cells:
        depths[tuple(cell)] = sqrt(((others - cell) ** 2).sum(axis=1).min())
    return depths
