"""Where on the ground all arms of a layout can work, with their grippers down."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from layouts.arrangement import Arrangement
from layouts.distances import farther, in_catalogue
from layouts.frames import Rectangle
from layouts.placement import Placement
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform
from robot_layouts.kinematics.solve import scattered
from robot_layouts.kinematics.tree import Tree
from robots import AssetError, MissingPackageError, RobotDescriptor
from robots.bodies.hulls import load_model
from robots.bodies.overlaps import overlapping
from robots.gripper_motion import aiming_joints, gripper_frame, home_of, link_tree
from robots.urdf.tcp import find_tcp

_SAMPLES = 20_000  # random joint positions per arm
_LEAST_DOWN = 0.3  # cosine between a gripper's approach and straight down
_CELL = 0.05  # of the shorter reach: edge of the cells that places are counted in
HEIGHT = 0.35  # of the shorter reach: how high above the ground places are looked for
_DEEP = 0.8  # of the depth of the deepest place, that is deep enough
_OFTEN = 3  # samples in a cell and its neighbours that show it to be well within reach
_MANY = 20  # postures with the gripper down that show how far it gets so
# Of postures in which a gripper can take what lies on the ground: the heights, as shares of the
# reach; the cosine from straight down; which share of them reaches less far; how that is rounded.
# What is raised has to be in reach as well: no farther than the farthest posture at each height.
_LEVELS, _UPRIGHT, _FAR, _ROUNDED = ((0.0, 0.08), (0.08, 0.16), (0.16, 0.25)), 0.94, 0.9, 0.05
# What `_share_down` finds of the robots that tasks are declared for, whose files need not be there.
SHARES_DOWN = {"panda": 0.9, "panda_wristcam": 0.9, "franka_panda": 0.9}


def shared_place(
    layout: Arrangement,
    places: Sequence[str],
    table: Rectangle | None = None,
    height: float = HEIGHT,
    near: tuple[float, float] | None = None,
) -> tuple[tuple[float, float], float] | None:
    """Return the place on the ground that lies deepest within reach of all arms, and how deep (m).

    Or of the places that lie nearly as deep the one that is nearest to another.

    An arm reaches a place if random postures often bring its TCP there, near the ground and with
    the gripper pointing down more than it does aside. Of an arm on a body only postures count in
    which it is neither inside itself, the body, nor the table, as far as python-fcl can tell.

    Args:
        layout: The robots.
        places: The arms, by their names or places.
        table: Outline of the table that bodies work on, x_min, y_min, x_max, y_max (m).
        height: How near the ground postures count, as a share of the shorter reach.
        near: That other place, x and y (m, world).

    Returns:
        None if no place is in reach of all of them.

    Raises:
        AssetError: If robot files cannot be found.
    """
    reach = min(layout.arm(place).robot.reach for place in places)
    cell = _CELL * reach
    reached = [_near_ground(layout, place, height * reach, table) for place in places]
    if not all(map(len, reached)):  # a hand without an arm reaches no ground
        return None
    everywhere = np.concatenate(reached)
    low, high = everywhere.min(axis=0) - 2 * cell, everywhere.max(axis=0) + 2 * cell
    counts = np.ceil((high - low) / cell).astype(int)
    shared = np.ones(counts, bool)
    for points in reached:
        shared &= _often(points, low, cell, counts)
    if not shared.any():
        return None
    depths = _depths(shared) * cell
    if near is None:  # of equally deep places the one in the middle of all
        deep = np.argwhere(depths >= depths.max() - cell / 2)
        found = deep[np.argmin(np.abs(deep - deep.mean(axis=0)).sum(axis=1))]
    else:
        deep = np.argwhere(depths >= _DEEP * depths.max())
        found = deep[np.argmin(np.hypot(*(low + (deep + 0.5) * cell - near).T))]
    x, y = (low + (found + 0.5) * cell).tolist()
    return (x, y), float(depths[tuple(found)])


def working_factors(
    layout: Arrangement,
    own: Arrangement,
    places: Collection[str],
    holding: Container[str],
    needed: Mapping[str, float],
) -> tuple[float, list[float]]:
    """Return by which factor what arms do is larger than for a task's own, and how far they stand.

    By their reach, and no more than by how far they get with their grippers down if they hold
    things. What the task's own do is in reach of the one of them that reaches least, unless it is
    said how far a place needs.

    Args:
        layout: The robots.
        own: The task's own.
        places: The arms, by their places.
        holding: The places whose robots hold things.
        needed: How far arms have to reach where the task's own stand, by place (m).

    Returns:
        How much larger it is, and for each arm how much farther from the middle it stands; see
        `layouts.distances.farther`.
    """
    scales, distances = list[float](), list[list[float]]()
    for held in ((), holding):
        reaches, usual = (working_reaches(each, places, held) for each in (layout, own))
        wanted = [min(usual)] * len(usual)
        for i, place in enumerate(places):
            if place in needed:
                wanted[i] = needed[place] * usual[i] / own.arm(place).robot.reach
        scales.append(min(reach / want for reach, want in zip(reaches, wanted, strict=True)))
        distances.append(farther(reaches, wanted))
    return min(scales), [min(pair) for pair in zip(*distances, strict=True)]


def working_reaches(
    layout: Arrangement, places: Iterable[str], holding: Container[str]
) -> list[float]:
    """Return how far arms of a layout reach where they work (m).

    Those that hold things do with their grippers about straight down, near the ground they stand
    on: random postures say how far from their bases. It is the reach of their descriptors for all
    others, and for those on wheels, that hardly get there, or whose files are not at hand.

    Args:
        layout: The robots.
        places: The arms, by their places.
        holding: The places whose robots hold things.
    """
    return [
        layout.arm(place).robot.reach * (_share_down(layout, place) if place in holding else 1.0)
        for place in places
    ]


def _share_down(layout: Arrangement, place: str) -> float:
    """Return at which share of its reach an arm still gets to the ground with its gripper down."""
    arm, owner = layout.arm(place), layout[layout.owner(place)]
    if arm.robot.name in SHARES_DOWN and in_catalogue(arm.robot):
        return SHARES_DOWN[arm.robot.name]
    base = pose_matrix(owner.base_pose.position, owner.base_pose.quaternion)
    body = body_joints(owner, arm.robot)
    try:
        points, approaches = places_and_approaches(owner.robot, arm.robot, body)
    except AssetError:
        return 1.0
    x, y, z = arm.base_position
    ground = z if owner.robot.limbs else max(z, 0.0)  # one that stands lower works at z = 0
    points = (transform(base, points) - (x, y, ground)) / arm.robot.reach
    upright = points[(approaches @ base[:3, :3].T)[:, 2] < -_UPRIGHT]
    levels = [upright[(low < upright[:, 2]) & (upright[:, 2] <= high)] for low, high in _LEVELS]
    if sum(map(len, levels)) < _MANY:
        return 1.0
    far = float(np.quantile(np.hypot(*np.concatenate(levels)[:, :2].T), _FAR))
    ends = [float(np.hypot(*at[:, :2].T).max()) for at in levels if len(at) >= _MANY]
    steps = [round(far / _ROUNDED), *(int(end / _ROUNDED) for end in ends)]
    return round(min(steps) * _ROUNDED, 2)


def _near_ground(layout: Arrangement, place: str, height: float, table: Rectangle | None) -> Floats:
    """Return where postures bring a TCP that is low and points down, (n, 2) (m, world)."""
    owner, arm = layout[layout.owner(place)], layout.arm(place).robot
    base = pose_matrix(owner.base_pose.position, owner.base_pose.quaternion)
    body = body_joints(owner, arm)
    points, approaches = places_and_approaches(owner.robot, arm, body)
    points, approaches = transform(base, points), approaches @ base[:3, :3].T
    low = (points[:, 2] > 0) & (points[:, 2] < height) & (approaches[:, 2] < -_LEAST_DOWN)
    if limb := layout.arm_name(place).partition(".")[2]:
        low &= _is_on(points, table)
        with suppress(MissingPackageError):  # all of them count then
            low[low] = are_clear(owner, limb, drawn_postures(owner.robot, arm, body)[low], table)
    return points[low, :2]


def are_clear(
    placement: Placement,
    limb: str,
    qpos: Floats,
    table: Rectangle | None = None,
    *,
    alone: bool = True,
) -> NDArray[np.bool_]:
    """Return whether a limb is inside neither itself, its body nor a table, (n,).

    Args:
        placement: The body.
        limb: One of its limbs; empty for all of a robot that has none.
        qpos: All joints of the body, (n, dof) (rad, m).
        table: Outline of a table whose top is at z = 0 (m).
        alone: Whether the other limbs do not count.

    Raises:
        AssetError: If robot files cannot be found.
        MissingPackageError: If python-fcl is not installed.
    """
    model, robot = load_model(placement.robot), placement.robot
    parts = {name: robot.parts[name] for name in robot.limbs} if limb else {"": robot}
    carried = {name: _carried(model.kinematics, robot, part) for name, part in parts.items()}
    own = carried.pop(limb)
    others = frozenset().union(*carried.values()) if alone else frozenset()
    links = [hull.link for hull in model.hulls]
    pairs = [
        pair
        for pair in model.self_pairs
        if any(links[i] in own for i in pair) and not any(links[i] in others for i in pair)
    ]
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    arm = [hull for hull in model.hulls if hull.link in own]
    return np.array(
        [
            not overlapping(model.hulls, poses, pairs).any()
            and not any(
                inside_table(transform(poses[hull.link], hull.corners), table).any() for hull in arm
            )
            for poses in base @ model.kinematics.forward(qpos)
        ],
        bool,
    )


def _carried(tree: Tree, robot: RobotDescriptor, part: RobotDescriptor) -> frozenset[int]:
    """Return the links that the joints of a part of a robot move."""
    columns = [robot.joints.index(joint) for joint in part.joints]
    moved = np.isin(tree.drivers, columns)
    return frozenset(i for i in range(len(tree.links)) if moved[list(tree.path(i))].any())


def body_corners(placement: Placement) -> Floats:
    """Return the corners of a robot's hulls that no arm or limb carries, (n, 3) (m, world)."""
    model, robot = load_model(placement.robot), placement.robot
    arms = [robot.parts[limb] for limb in robot.limbs] or [robot]
    limbs = [_carried(model.kinematics, robot, arm) for arm in arms]
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    poses = base @ model.kinematics.forward(np.array([placement.start_qpos]))[0]
    body = [hull for hull in model.hulls if not any(hull.link in links for links in limbs)]
    corners = [transform(poses[hull.link], hull.corners) for hull in body]
    return np.concatenate([np.zeros((0, 3)), *corners])


def inside_table(points: Floats, table: Rectangle | None) -> NDArray[np.bool_]:
    """Return which points, (n, 3) (m, world), are inside a table, (n,)."""
    return _is_on(points, table) & (points[:, 2] < 0) & (table is not None)


def _is_on(points: Floats, table: Rectangle | None) -> NDArray[np.bool_]:
    """Return which points, (n, 3) (m, world), are above or inside a table; all of them if None."""
    x_min, y_min, x_max, y_max = table or (-np.inf, -np.inf, np.inf, np.inf)
    x, y, _ = points.T
    return (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)


def body_joints(placement: Placement, arm: RobotDescriptor) -> tuple[float, ...]:
    """Return where joints start that are driven with an arm, but are not to aim it (rad, m)."""
    robot, start = placement.robot, placement.start_qpos
    return tuple(start[robot.joints.index(joint)] for joint in _of_body(robot, arm))


def _of_body(robot: RobotDescriptor, arm: RobotDescriptor) -> list[str]:
    return [joint for joint in arm.arm_joints if joint not in aiming_joints(robot, arm)]


def drawn_postures(
    robot: RobotDescriptor, arm: RobotDescriptor, body: tuple[float, ...] = ()
) -> Floats:
    """Return the random postures of an arm, (n, dof) (rad, m).

    Args:
        robot: The robot.
        arm: The robot itself, or a limb of it.
        body: See `body_joints`.
    """
    tree = link_tree(robot)
    home = home_of(robot, tree)
    home[[robot.joints.index(joint) for joint in _of_body(robot, arm)]] = body
    columns = [robot.joints.index(joint) for joint in aiming_joints(robot, arm)]
    qpos = np.tile(home, (_SAMPLES, 1))
    qpos[:, columns] = scattered(tree.limits[columns], _SAMPLES)
    return qpos


@lru_cache(maxsize=32)
def places_and_approaches(
    robot: RobotDescriptor, arm: RobotDescriptor, body: tuple[float, ...] = ()
) -> tuple[Floats, Floats]:
    """Return places and approaches of an arm's gripper in random postures, (n, 3) each, root."""
    qpos, tree = drawn_postures(robot, arm, body), link_tree(robot)
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
