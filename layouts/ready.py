"""How robots stand ready: on the ground or behind a table, hands above what they work on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from layouts.distances import SHOULDER
from layouts.frames import Rectangle
from layouts.placement import LARGEST_NOISE, Placement
from layouts.shared_place import (
    are_clear,
    body_corners,
    body_joints,
    drawn_postures,
    inside_table,
    places_and_approaches,
)
from layouts.validation.collisions import moving_hulls, noisy_postures
from robot_layouts.kinematics.quaternions import forward
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix, transform
from robot_layouts.kinematics.solve import IkGoal, shortfalls, solve
from robot_layouts.kinematics.tree import FIXED, Tree
from robots.bodies.hulls import load_model
from robots.descriptor import RobotDescriptor, Vector3
from robots.gripper_motion import aiming_joints, gripper_frame, link_tree
from robots.urdf.tcp import find_tcp

if TYPE_CHECKING:
    from layouts.layout import Layout

CLEARANCE, STEP = 0.02, 0.01  # m: from a body to the table; in which it is moved back
POSTURES = 21  # of a torso that are looked at
TALL = 0.75  # of a reach: how high above a robot's base its arm begins at most to work down there
FINGER = 3  # joints of a finger; what has no more does not point a gripper down
HIGHEST = 0.5  # of a reach, by which a robot is raised at most
HEIGHT = 0.22  # of a reach: how high above the ground hands wait
BACK = 0.35  # of a reach: how far ahead a hand waits that is drawn back
ASIDE = 0.15  # of a reach: how far aside from the middle of what is worked on, at least
DOWN = 0.5  # of a reach, that a gripper is worth which points down instead of level
STARTS = 100  # random postures that hands are brought to their places from
ITERATIONS = 30
MISSING, TURNED = 0.02, 0.35  # m and rad that a posture may miss
NOISES, NOISIER = 20, 2.0  # draws of joint noise in which nothing may touch; times its deviation


def made_ready(
    placement: Placement,
    limbs: Sequence[str],
    place: tuple[float, float],
    table: Rectangle | None = None,
) -> Placement:
    """Return the placement of a body that starts with its hands over a place, grippers down.

    Each hand is before its own shoulder. Nothing is inside itself, another hand or the table, with
    joint noise, either. A limb that has no such posture stays as it is, and so does all else.

    Args:
        placement: The body.
        limbs: Its limbs that are to be ready.
        place: The middle of what is worked on, x and y (m, world).
        table: Outline of a table whose top is at z = 0, x_min, y_min, x_max, y_max (m).

    Raises:
        AssetError: If robot files cannot be found.
        MissingPackageError: If python-fcl is not installed.
    """
    random = np.random.default_rng(0)
    for limb in limbs:
        arm, shoulder = placement.robot.parts[limb], placement.robot.limbs[limb].base[1]
        aside = np.sign(shoulder) * max(abs(shoulder), ASIDE * arm.reach)
        left = pose_matrix(placement.base_position, placement.base_quaternion)[:3, 1]
        at = (*place, HEIGHT * arm.reach) + aside * left
        placement = _over(placement, limb, at, table, random)
    return placement


def drawn_back(placement: Placement, place: tuple[float, float]) -> Placement:
    """Return the placement of an arm that starts with its hand near it, gripper down.

    One that has no such posture stays as it is. It works level with its base, or at z = 0 if it
    stands lower.

    Args:
        placement: The arm.
        place: What it is to face, x and y (m, world).

    Raises:
        AssetError: If robot files cannot be found.
        MissingPackageError: If python-fcl is not installed.
    """
    base, reach = np.array(placement.base_position), placement.robot.reach
    ahead = np.array((*place, base[2])) - base
    at = base + BACK * reach * ahead / np.linalg.norm(ahead)
    at[2] = max(base[2], 0.0) + HEIGHT * reach
    return _over(placement, "", at, None, np.random.default_rng(0))


def _over(
    placement: Placement,
    limb: str,
    at: Floats,
    table: Rectangle | None,
    random: np.random.Generator,
) -> Placement:
    """Return a placement whose robot, or a limb of it, starts with its hand at a place."""
    for qpos in _postures(placement, limb, at):
        ready = replace(placement, keyframe=None, qpos=[round(at, 4) for at in qpos.tolist()])
        noisier = replace(ready, qpos_noise=min(NOISIER * ready.qpos_noise, LARGEST_NOISE))
        draws = noisy_postures(noisier, NOISES, random)
        if are_clear(placement, limb, draws, table, alone=False).all():
            return ready
    return placement


def grounded(placement: Placement) -> Placement:
    """Return the placement of a robot that starts as `stooped`, and is raised by its `lift`.

    One that stands lower then begins with its hand over the table that is before it.

    Args:
        placement: The robot, upright.

    Raises:
        AssetError: If robot files cannot be found.
        MissingPackageError: If one stands lower, and python-fcl is not installed.
    """
    start = stooped(placement)
    x, y, z = start.local_pose.position
    if z < placement.local_pose.position[2]:
        ahead_x, ahead_y, _ = forward(start.facing)
        return drawn_back(start, (x + ahead_x, y + ahead_y))
    return replace(start, position=(x, y, z + lift(start)))


def stooped(placement: Placement) -> Placement:
    """Return the placement of a robot that starts with its shoulder low enough.

    Its arm begins `SHOULDER` of its reach above what it works on, or as near to that as its torso
    can, if it has one that slides and is driven. Where it still begins higher than `TALL` of its
    reach, a robot with one arm that stands in no frame stands so much lower, as before a table;
    fingers, which hang from a frame of their own, do not.

    Args:
        placement: The robot, upright.

    Raises:
        AssetError: If robot files cannot be found.
    """
    robot, tree = placement.robot, link_tree(placement.robot)
    path = tree.path(find_tcp(robot, tree).turned)
    drivers = [tree.coordinates[at] if at != FIXED else "" for at in tree.drivers]
    aiming, qpos = aiming_joints(robot, robot), np.array(placement.start_qpos)
    shoulder = _shoulder(robot, tree)
    for joint in (drivers[link] for link in path if tree.slides[link]):
        if joint not in robot.arm_joints or joint in aiming:
            continue
        column = robot.joints.index(joint)
        rows = np.tile(qpos, (POSTURES, 1))
        low, high = np.clip(tree.limits[column], -robot.reach, robot.reach)
        rows[1:, column] = np.linspace(low, high, POSTURES - 1)
        heights = tree.forward(rows)[:, shoulder, 2, 3]
        off = np.abs(heights - SHOULDER * robot.reach)
        qpos = rows[np.argmin(off.round(3))]
    if not np.array_equal(qpos, placement.start_qpos):
        placement = replace(placement, keyframe=None, qpos=qpos.tolist())
    if placement.on or not (height := _too_high(placement)):
        return placement
    x, y, z = placement.local_pose.position
    return replace(placement, position=(x, y, round(z + SHOULDER * robot.reach - height, 3)))


def _too_high(placement: Placement) -> float:
    """Return how high above its base an arm begins that cannot work down there (m); 0 if it can."""
    robot, tree = placement.robot, link_tree(placement.robot)
    if len(aiming_joints(robot, robot)) <= FINGER or robot.limbs:
        return 0.0
    poses = tree.forward(np.array([placement.start_qpos]))
    height = float(poses[0, _shoulder(robot, tree), 2, 3])
    return height if height > TALL * robot.reach else 0.0


def _shoulder(robot: RobotDescriptor, tree: Tree) -> int:
    """Return the first link that is moved by a joint which aims the arm; the root if none is."""
    aiming = aiming_joints(robot, robot)
    path = tree.path(find_tcp(robot, tree).turned)
    driven = ((link, tree.drivers[link]) for link in path)
    return next((link for link, at in driven if at != FIXED and tree.coordinates[at] in aiming), 0)


def lift(placement: Placement) -> float:
    """Return by how much a robot is to be raised so that nothing of it is in the ground (m).

    The ground is level with its base; what is rigid with the base may go into it, as a pedestal
    does. A robot that would stand too high to work there, on legs perhaps, is not raised at all.

    Args:
        placement: The robot, upright.

    Raises:
        AssetError: If robot files cannot be found.
    """
    model = load_model(placement.robot)
    noisier = replace(placement, qpos_noise=min(NOISIER * placement.qpos_noise, LARGEST_NOISE))
    poses = model.kinematics.forward(noisy_postures(noisier, NOISES, np.random.default_rng(0)))
    upright = pose_matrix((0.0, 0.0, 0.0), placement.local_pose.quaternion)
    moving = [model.hulls[i] for i, _ in moving_hulls(model)]
    corners = [
        transform(upright @ row[hull.link], hull.corners) for row in poses for hull in moving
    ]
    lowest = min((points[:, 2].min() for points in corners), default=0.0)
    if not -HIGHEST * placement.robot.reach < lowest < 0:
        return 0.0
    return math.floor(1.0 - 1e3 * lowest) / 1e3  # whole millimetres


def off_the_table(
    placement: Placement, ahead: tuple[float, float], table: Rectangle | None
) -> Placement:
    """Return the placement of a body so far back that all of it but its limbs is clear of a table.

    Args:
        placement: The body.
        ahead: Which way it faces, x and y (world), of length 1.
        table: Outline of a table whose top is at z = 0, x_min, y_min, x_max, y_max (m).

    Raises:
        AssetError: If robot files cannot be found.
        MissingPackageError: If python-fcl is not installed.
    """
    if table is None:
        return placement
    x_min, y_min, x_max, y_max = table
    wide = (x_min - CLEARANCE, y_min - CLEARANCE, x_max + CLEARANCE, y_max + CLEARANCE)
    corners = body_corners(placement)
    steps = 0
    while inside_table(corners - np.array((*ahead, 0.0)) * STEP * steps, wide).any():
        steps += 1
    x, y, z = placement.base_position
    back = STEP * steps
    return replace(
        placement, position=(round(x - back * ahead[0], 4), round(y - back * ahead[1], 4), z)
    )


def before_robots(table: Rectangle, layout: Layout) -> Rectangle:
    """Return the outline of a table that ends before robots of high shoulders that stand lower.

    It is cut along one side for each of them that would stand in it: where all other robots stay
    on it, if there is such a side, and where most of it is left. Other robots in it stay in it.

    Args:
        table: Its outline, if none were lower; its top is at z = 0: x_min, y_min, x_max, y_max (m).
        layout: The robots.

    Raises:
        AssetError: If the files of robots that are lower cannot be found.
    """
    lower = [at for at in layout.values() if at.base_position[2] < 0 and _too_high(at)]
    others = [at.base_position for at in layout.values() if at not in lower]
    for placement in lower:
        corners = body_corners(placement)
        inside = corners[inside_table(corners, table)]
        if not inside.size:
            continue
        (low_x, low_y), (high_x, high_y) = (
            inside[:, :2].min(0) - CLEARANCE,
            inside[:, :2].max(0) + CLEARANCE,
        )
        x_min, y_min, x_max, y_max = table
        rests = [
            (x_min, y_min, low_x, y_max),
            (high_x, y_min, x_max, y_max),
            (x_min, y_min, x_max, low_y),
            (x_min, high_y, x_max, y_max),
        ]
        rest = max(rests, key=lambda rest: (_kept(rest, others), _area(rest)))
        table = rest if _area(rest) else table  # a robot that fills it is in its way
    x_min, y_min, x_max, y_max = map(float, table)
    return x_min, y_min, x_max, y_max


def _kept(table: Rectangle, places: Sequence[Vector3]) -> int:
    x_min, y_min, x_max, y_max = table
    return sum(x_min < x < x_max and y_min < y < y_max for x, y, _ in places)


def _area(table: Rectangle) -> float:
    x_min, y_min, x_max, y_max = table
    return max(x_max - x_min, 0.0) * max(y_max - y_min, 0.0)


def _postures(placement: Placement, limb: str, target: Floats) -> Floats:
    """Return postures that bring a hand to a place, gripper down, (n, dof) (rad, m).

    The most comfortable comes first. The limb is empty if the robot has but one hand.
    """
    robot, tree = placement.robot, link_tree(placement.robot)
    arm = robot.parts[limb] if limb else robot
    columns = [robot.joints.index(joint) for joint in arm.arm_joints]
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    body = body_joints(placement, arm)
    places, approaches = places_and_approaches(robot, arm, body)
    away = np.linalg.norm(transform(base, places) - target, axis=1)
    away += DOWN * arm.reach * (approaches @ base[2, :3])
    nearest = np.argsort(away)[:STARTS]
    qpos = np.tile(placement.start_qpos, (STARTS, 1))
    qpos[:, columns] = drawn_postures(robot, arm, body)[nearest][:, columns]
    tcp, frame = find_tcp(arm, tree), gripper_frame(arm)
    turns = base[:3, :3] @ tree.forward(qpos)[:, tcp.turned, :3, :3] @ frame
    goal = IkGoal(
        transform(inverse_pose(base), np.tile(target, (STARTS, 1))),
        tcp.links,
        base[:3, :3].T @ _downwards(turns) @ frame.T,
        tcp.turned,
        tcp.offset if tcp.offset.any() else None,
    )
    qpos = solve(tree, goal, qpos, columns, ITERATIONS).qpos
    missing, turned = shortfalls(tree, goal, qpos)
    qpos = qpos[(missing < MISSING) & (turned < TURNED)]
    return qpos[np.argsort(_strain(tree, qpos, columns))]


def _downwards(turns: Floats) -> Floats:
    """Return the orientations of grippers that point down and head where others do, (n, 3, 3)."""
    across = turns[:, :, 0] * (1.0, 1.0, 0.0)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    down = np.broadcast_to((0.0, 0.0, -1.0), across.shape)
    return np.stack([across, np.cross(down, across), down], axis=2)


def _strain(tree: Tree, qpos: Floats, columns: Sequence[int]) -> Floats:
    """Return how far joints are from the middle of their ranges, from 0 to 1, squared, (n,)."""
    low, high = np.clip(tree.limits[columns], -np.pi, np.pi).T
    return (((2 * qpos[:, columns] - low - high) / (high - low)) ** 2).mean(axis=1)
