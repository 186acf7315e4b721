"""How a gripper moves: where it points, how its fingers part, and how wide it opens.

A gripper's frame has z as its approach and y as the way in which the fingers part, whatever the
axes of its TCP link.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from robot_layouts.core.errors import DescriptorError
from robot_layouts.kinematics.rotations import Floats, inverse_pose, quaternion_of, transform
from robot_layouts.kinematics.tree import FIXED, Tree
from robots.action_split import JointGroup, is_gripper
from robots.bodies.hulls import shape_corners
from robots.descriptor import RobotDescriptor
from robots.parts import PINCH
from robots.urdf.model import UrdfModel
from robots.urdf.reading import model_of
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree

_AXIS_ALIGNED = 0.7  # cosine; a TCP link that is turned less has the gripper's frame
_SHORT = 1e-4  # m; shorter ways have no direction
_POSTURES = 9  # of the gripper between its limits, of which the most closed and the next count
SHARES = np.linspace(0.0, 1.0, 65)  # at which openings are worked out
_LEAST_WORK = 1e-9  # J; of drives that have no stiffness
_SLIDES = 1e-6  # rad; fingers that turn less against each other slide
_TOUCH = 2e-3  # m; jaws that are less deep in each other when closed, or less far apart, touch
_SLIGHT = 0.1  # of the longest way of a joint; those that go less say little of how far it is open
_AJAR = 8  # number of the share at which the pads' way is seen


class GripperMotion:
    """Where the fingers of a robot or a limb are as its gripper opens.

    Each finger's pad is where the TCP lies when the gripper is closed: there fingers meet, but for
    jaws that slide and whose shapes are then inside each other, or apart: those meet before, or
    never. How far a gripper is open is given as a share, 0 where the action number -1 drives it,
    or closes it as far as its joints go, and 1 where the number 1 does; of a hand whose descriptor
    has the keyframe `pinch` 0 there, and 1 at home.

    Attributes:
        joints: Names of the gripper's joints.
        openings: Distance of the two pads at evenly spaced shares from 0 to 1, (65,) (m).
        angles: How far they are turned against each other there, from where they meet, (65,) (rad).
        turn: Orientation of the gripper's frame in the TCP link's, (3, 3): its y axis is the way in
            which the pads part at first, whatever `robots.Fingers` says of contact forces.
        beyond: How far the fingers' shapes reach beyond the pads when closed, the way the gripper
            points (m); 0 of fingers without shapes.
    """

    def __init__(self, robot: RobotDescriptor) -> None:
        """Take a robot or a limb.

        Raises:
            DescriptorError: If it has no fingers, or no gripper that is driven between two ends.
            AssetError: If its files cannot be found.
        """
        if robot.fingers is None:
            raise DescriptorError(f"{robot.name} has no fingers")
        groups = [g for name, g in robot.action_split.groups.items() if is_gripper(name)]
        groups = [group for group in groups if group.size]
        if not groups:
            raise DescriptorError(f"{robot.name} has fingers, but no gripper that is driven")
        tree = gripper_tree(robot)
        self.joints = tuple(joint for group in groups for joint in group.joints)
        places = [robot.joints.index(joint) for joint in self.joints]
        limits = tree.limits[places]
        ends = np.concatenate([ends_of(group, tree.limits, robot) for group in groups])
        self._ends = np.clip(ends, limits[:, :1], limits[:, 1:])
        self._travels = self._ends[:, 1] - self._ends[:, 0]
        if not np.isfinite(self._ends).all() or not self._travels.any():
            raise DescriptorError(
                f"the gripper of {robot.name} has no two ends between which it moves: its joints"
                f" {', '.join(self.joints)} have no limits, or stay where they are"
            )
        self._work = float(np.concatenate(list(map(_pressing, groups))) @ self._travels**2)
        rows = np.tile(home_of(robot, tree), (len(SHARES), 1))
        rows[:, places] = self._positions(SHARES)
        poses = tree.forward(rows)
        tcp = find_tcp(robot, tree)
        hand = np.linalg.inv(poses[:, tcp.turned])
        meeting = tcp.places(poses[:1])[0]
        fingers = [tree.link(link) for link in robot.fingers.links]
        pads = [inverse_pose(poses[0, finger]) for finger in fingers]
        one, other = (
            transform(hand @ poses[:, finger], transform(pad, meeting))
            for finger, pad in zip(fingers, pads, strict=True)
        )
        self._middles = (one + other) / 2
        first, second = (poses[:, finger, :3, :3] for finger in fingers)
        self.angles = _turned(np.swapaxes(first, 1, 2) @ second)
        apart = np.linalg.norm(one - other, axis=1)
        shapes = _shapes(robot, hand[0] @ poses[0, fingers])
        if self.angles.max() < _SLIDES:
            apart = np.maximum(apart - _inside(shapes, one - other), 0)
        self.openings = apart
        wrist = transform(hand[0], poses[0, _wrist_of(robot, tree), :3, 3])
        self.turn = _axes(self._middles[0] - wrist, (one - other)[_AJAR])
        ahead = [(corners - self._middles[0]) @ self.turn[:, 2] for corners in shapes]
        self.beyond = max((float(along.max()) for along in ahead), default=0.0)

    @property
    def widest(self) -> float:
        """How far the pads get apart (m)."""
        return float(self.openings.max())

    def widest_within(self, angle: float) -> float:
        """Return how far the pads get apart while they are turned by less than an angle (m)."""
        return float(self.openings[self.angles < angle].max(initial=0.0))

    def share(self, opening: float) -> float:
        """Return the least share at which the pads are so far apart (m); 1 if they never are."""
        wide = np.flatnonzero(self.openings >= opening)
        return float(SHARES[wide[0]]) if len(wide) else float(SHARES[self.openings.argmax()])

    def angle(self, share: float) -> float:
        """Return how far the pads are turned against each other at a share (rad)."""
        return float(np.interp(share, SHARES, self.angles))

    def slope(self, share: float) -> float:
        """Return how much wider the gripper opens per share there (m)."""
        low, high = np.clip((share - 0.05, share + 0.05), (0.0, SHARES[1]), (SHARES[-2], 1.0))
        wide = np.interp((low, high), SHARES, self.openings)
        return float((wide[1] - wide[0]) / (high - low))

    def pressing(self, force: float, share: float) -> float:
        """Return by how much of a share a target is more closed that presses with a force (N).

        By virtual work: the forces of the drives along the joints' ways are those of the fingers
        along theirs.
        """
        return force * self.slope(share) / max(self._work, _LEAST_WORK)

    def force(self, step: float, share: float) -> float:
        """Return the force that a target presses with which is more closed by a length (m) (N)."""
        return step * self._work / max(abs(self.slope(share)), _SHORT) ** 2

    def share_at(self, positions: Floats) -> float:
        """Return how far the gripper is open with its joints at some positions (rad, m)."""
        travels = np.abs(self._travels)
        moves = travels > _SLIGHT * travels.max()
        return float(np.mean((positions - self._ends[:, 0])[moves] / self._travels[moves]))

    def positions(self, share: float) -> Floats:
        """Return the gripper's joints at a share, (joints,) (rad, m)."""
        return self._positions(np.array([share]))[0]

    def middle(self, share: float) -> Floats:
        """Return the point between the pads at a share, in the TCP link's frame, (3,) (m)."""
        columns = [np.interp(share, SHARES, column) for column in self._middles.T]
        return np.array(columns)

    def _positions(self, shares: Floats) -> Floats:
        return np.asarray(self._ends[:, 0] + shares[:, None] * self._travels)


def _pressing(group: JointGroup) -> Floats:
    """Return the stiffness with which each joint of a gripper presses (N·m/rad, N/m).

    Of a linkage only the leaders do: the others go where these are.
    """
    stiffness = np.broadcast_to(np.array(group.stiffness, float), len(group.joints))
    return stiffness * [not group.leaders or joint in group.leaders for joint in group.joints]


def _shapes(robot: RobotDescriptor, closed: Floats) -> list[Floats]:
    """Return the corners of the shapes of each finger that has any, (n, 3) (m).

    Args:
        robot: Whose fingers they are.
        closed: Poses of the two links, (2, 4, 4) (m).
    """
    assert robot.fingers is not None
    solids, urdf = _model(robot).collisions, robot.urdf.locate()
    return [
        transform(pose, np.concatenate([shape_corners(shape, urdf) for shape in solids[link]]))
        for pose, link in zip(closed, robot.fingers.links, strict=True)
        if solids.get(link)
    ]


def _inside(shapes: Sequence[Floats], apart: Floats) -> float:
    """Return how far the shapes of two jaws are inside each other when closed (m).

    That is below 0 of jaws that are apart then, and 0 of those that about touch.

    Args:
        shapes: Their corners, for each jaw (m).
        apart: From the second pad to the first as they slide apart, (shares, 3) (m).
    """
    if len(shapes) != 2:
        return 0.0
    one, other = (corners @ _unit(apart[-1]) for corners in shapes)
    deep = float(other.max() - one.min())
    return deep if _TOUCH < abs(deep) < np.linalg.norm(apart[-1]) else 0.0


def _turned(rotations: Floats) -> Floats:
    """Return by how much rotations, (n, 3, 3), differ from the first of them, (n,) (rad)."""
    traces = np.trace(rotations[0].T @ rotations, axis1=1, axis2=2)
    return np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))


@lru_cache(maxsize=64)
def gripper_motion(robot: RobotDescriptor) -> GripperMotion:
    """Return how the gripper of a robot or a limb moves; see `GripperMotion` for errors."""
    return GripperMotion(robot)


def ends_of(group: JointGroup, limits: Floats, robot: RobotDescriptor) -> Floats:
    """Return where each joint of a gripper is when closed and when open, (joints, 2) (rad, m).

    Args:
        group: The gripper's.
        limits: Of the robot's joints, in the descriptor's order, (dof, 2) (rad, m).
        robot: The robot.
    """
    places = [robot.joints.index(joint) for joint in group.joints]
    own = limits[places]
    if PINCH in robot.keyframes:
        ends = [robot.keyframe(name) for name in (PINCH, robot.home.keyframe)]
        return np.array(ends, float)[:, places].T
    if group.delta or group.target or group.command != "position":
        return own
    ranges = np.array(group.ranges, float)
    ranges = np.repeat(ranges, len(group.joints), axis=0) if group.mimic else ranges
    shares, offsets = np.array(group.followers).T
    return ranges * shares[:, None] + offsets[:, None]


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
        turned = gripper_frame(robot)
        aligned = abs(turned[1, 1]) > _AXIS_ALIGNED and turned[2, 2] > _AXIS_ALIGNED
        return None if aligned else quaternion_of(turned)
    tree, qpos = gripper_tree(robot), np.array(robot.keyframe(robot.home.keyframe), float)
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
        postures.append(tips(tree, robot, qpos))
    shut, ajar, *_ = sorted(postures, key=_gap)
    approach = _unit(shut.mean(0))
    apart = ajar[-1] - ajar[0]
    opening = _unit(apart - apart @ approach * approach)
    if not (approach.any() and opening.any()):
        return None
    return quaternion_of(np.stack([np.cross(opening, approach), opening, approach], 1))


def gripper_frame(robot: RobotDescriptor) -> Floats:
    """Return the orientation of the gripper's frame in the TCP link's, (3, 3).

    That of a robot without fingers, or whose fingers nothing drives, is the TCP link's own.
    """
    try:
        return gripper_motion(robot).turn
    except DescriptorError:
        return np.eye(3)


def hand_links(robot: RobotDescriptor, tree: Tree) -> frozenset[str]:
    """Return the names of a tree's links that the last joint of the arm moves, its gripper's too.

    Raises:
        AssetError: If its files cannot be found.
    """
    wrist = _wrist_of(robot, tree)
    return frozenset(link for i, link in enumerate(tree.links) if wrist in tree.path(i))


def _wrist_of(robot: RobotDescriptor, tree: Tree) -> int:
    """Return the link that the last joint of the arm moves."""
    arm = [joint.child for joint in _model(robot).ordered if joint.name in robot.arm_joints]
    return max(map(tree.link, arm), key=lambda at: len(tree.path(at)), default=0)


def _axes(ahead: Floats, apart: Floats) -> Floats:
    """Return the frame whose y axis is one way, and whose z axis is nearest to another, (3, 3)."""
    opening = _unit(apart)
    opening = opening * np.sign(opening.sum()) if opening.any() else np.array((0.0, 1.0, 0.0))
    approach = _unit(ahead - ahead @ opening * opening)
    if not approach.any():
        approach = _unit(np.cross((1.0, 0.0, 0.0), opening))
    return np.stack([np.cross(opening, approach), opening, approach], axis=1)


@lru_cache(maxsize=64)
def link_tree(robot: RobotDescriptor) -> Tree:
    """Return the tree of a robot's links; its coordinates are the descriptor's joints.

    Raises:
        AssetError: If its files cannot be found.
    """
    return kinematic_tree(_model(robot), robot.joints)


@lru_cache(maxsize=64)
def gripper_tree(robot: RobotDescriptor) -> Tree:
    """Return the tree of a robot's or a limb's links; joints of others follow its coordinates."""
    model = _model(robot)
    others = [j.name for j in model.moving if j.name not in robot.joints and j.mimics is None]
    return kinematic_tree(model, (*robot.joints, *others))


def home_of(robot: RobotDescriptor, tree: Tree) -> Floats:
    """Return the coordinates of a `gripper_tree` at home, other limbs' at 0 (rad, m)."""
    qpos = np.array(robot.keyframe(robot.home.keyframe), float)
    return np.pad(qpos, (0, len(tree.coordinates) - len(qpos)))


@lru_cache(maxsize=64)
def aiming_joints(robot: RobotDescriptor, arm: RobotDescriptor) -> tuple[str, ...]:
    """Return those of an arm's joints that are to bring its hand somewhere.

    They carry the hand, and nothing else that moves with the arm: not a head, nor a torso with it.

    Args:
        robot: The robot.
        arm: The robot itself, or a limb of it.

    Raises:
        AssetError: If its files cannot be found.
    """
    tree = link_tree(robot)
    drivers = [tree.coordinates[at] if at != FIXED else "" for at in tree.drivers]
    own = [drivers[link] for link in tree.path(find_tcp(arm, tree).turned)]
    beside = [i for i, at in enumerate(drivers) if at in arm.arm_joints and at not in own]
    shared = {drivers[link] for end in beside for link in tree.path(end)}
    carrying = [joint for joint in arm.arm_joints if joint in own]
    return tuple([joint for joint in carrying if joint not in shared] or carrying)


def tips(tree: Tree, robot: RobotDescriptor, qpos: Floats) -> Floats:
    """Return the links whose mean is the TCP in the frame of the TCP link, (links, 3) (m)."""
    poses = _poses(tree, qpos)
    link = inverse_pose(poses[tree.link(robot.tcp_link)])
    return np.array([(link @ poses[tree.link(tip)])[:3, 3] for tip in robot.tcp_position_links])


def _model(robot: RobotDescriptor) -> UrdfModel:
    return model_of(robot.urdf.locate())


def _poses(tree: Tree, qpos: Floats) -> Floats:
    """Return the poses of a gripper's links; joints of other limbs, at 0, move all of them."""
    return tree.forward(np.pad(qpos, (0, len(tree.coordinates) - len(qpos)))[None])[0]


def _gap(points: Floats) -> float:
    return float(np.linalg.norm(points[-1] - points[0]))


def _unit(vector: Floats) -> Floats:
    """Return a vector of length 1; of length 0 if it has hardly any."""
    length = np.linalg.norm(vector)
    return vector / length if length > _SHORT else np.zeros(3)
