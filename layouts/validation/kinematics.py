"""Where a robot's links are for given joint positions, from its URDF alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from robots import AssetError, DescriptorError, UnknownNameError
from robots.urdf_xml import parse_urdf

Floats = NDArray[np.float64]

FIXED, TURNING, SLIDING = "fixed", ("revolute", "continuous"), "prismatic"


@dataclass(frozen=True)
class Joint:
    """A joint as the URDF declares it.

    Attributes:
        name: Joint name.
        type: ``fixed``, ``revolute``, ``continuous`` or ``prismatic``.
        parent: Link it hangs on.
        child: Link that it carries.
        origin: Its frame in the parent's, (4, 4).
        axis: Its axis in its own frame, (3,), unit length.
        lower: Lower limit (rad or m); minus infinity if it has none.
        upper: Upper limit (rad or m); infinity if it has none.
        follows: Name, multiplier and offset of the joint that it mimics, or None.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Floats
    axis: Floats
    lower: float
    upper: float
    follows: tuple[str, float, float] | None


class Kinematics:
    """Forward kinematics of many joint positions at once.

    Attributes:
        driven: The joints whose positions are given, in that order.
        links: Names of all links, parents before children.
        parents: For each link the index of its parent; -1 for the root.
        bodies: For each link the index of the first link that it is rigidly fixed to.
        limits: The (lower, upper) limit of each driven joint, (driven, 2) (rad, m).
    """

    def __init__(self, xml: bytes, urdf: str, driven: Sequence[str]) -> None:
        """Read a URDF.

        Args:
            xml: Its contents.
            urdf: Its path, for error messages.
            driven: Names of the joints that positions are given for; every joint that moves must
                be one of them or mimic one.

        Raises:
            AssetError: If it is no URDF, or its links and joints do not form one tree that moves.
            DescriptorError: If a driven joint does not exist, or a joint that moves has no drive.
        """
        root = parse_urdf(xml, urdf)
        joints = _read_joints(root, urdf)
        self._order = _tree(root, joints, urdf)
        self.driven = tuple(driven)
        self.links = (
            _root_link(root, joints, urdf),
            *(joint.child for joint in self._order),
        )
        self._index = {link: i for i, link in enumerate(self.links)}
        self.parents = (-1, *(self._index[joint.parent] for joint in self._order))
        self._followed = _follow(self._order, self.driven, urdf)
        self.bodies = self._rigid_bodies()
        by_name = {joint.name: joint for joint in joints}
        self.limits = np.array([(by_name[name].lower, by_name[name].upper) for name in driven])

    def link(self, name: str) -> int:
        """Return the index of a link.

        Raises:
            UnknownNameError: If there is no such link.
        """
        if name not in self._index:
            raise UnknownNameError("link", name, self.links)
        return self._index[name]

    def carrier(self, body: int) -> int:
        """Return the body that a rigid body hangs on; -1 for the root's.

        Args:
            body: One of ``bodies``.
        """
        return -1 if body == 0 else self.bodies[self.parents[body]]

    def forward(self, qpos: Floats) -> Floats:
        """Return the poses of all links in the frame of the root, (n, links, 4, 4).

        Args:
            qpos: Positions in the order of ``driven``, (n, driven) (rad, m).
        """
        poses = np.empty((len(qpos), len(self.links), 4, 4))
        poses[:, 0] = np.eye(4)
        for i, joint in enumerate(self._order, start=1):
            placed = poses[:, self.parents[i]] @ joint.origin
            poses[:, i] = placed @ self._motion(joint, qpos)
        return poses

    def axes(self, poses: Floats, link: int, joints: Sequence[int]) -> tuple[Floats, Floats]:
        """Return how a link moves, per unit of some joints: what turns and what slides.

        Joints that merely mimic are left out.

        Args:
            poses: What `forward` returned, (n, links, 4, 4).
            link: Index of the link.
            joints: Indices of driven joints.

        Returns:
            Two screws per joint in the root's frame, each (n, joints, 3): the angular velocity
            of the link (1/s per rad/s), and the velocity of a point of it at the origin.
        """
        turning = np.zeros((len(poses), len(joints), 3))
        sliding = np.zeros_like(turning)
        names = [self.driven[j] for j in joints]
        while link > 0:
            joint = self._order[link - 1]
            if joint.name in names:
                column = names.index(joint.name)
                axis = poses[:, link, :3, :3] @ joint.axis
                if joint.type == SLIDING:
                    sliding[:, column] = axis
                else:
                    turning[:, column] = axis
                    sliding[:, column] = np.cross(poses[:, link, :3, 3], axis)
            link = self.parents[link]
        return turning, sliding

    def _motion(self, joint: Joint, qpos: Floats) -> Floats:
        motion = np.broadcast_to(np.eye(4), (len(qpos), 4, 4)).copy()
        if joint.type == FIXED:
            return motion
        index, multiplier, offset = self._followed[joint.name]
        moved = multiplier * qpos[:, index] + offset
        if joint.type == SLIDING:
            motion[:, :3, 3] = moved[:, None] * joint.axis
        else:
            motion[:, :3, :3] = turned(joint.axis, moved)
        return motion

    def _rigid_bodies(self) -> tuple[int, ...]:
        bodies = [0]
        for i, joint in enumerate(self._order, start=1):
            bodies.append(bodies[self.parents[i]] if joint.type == FIXED else i)
        return tuple(bodies)


def turned(axis: Floats, angles: Floats) -> Floats:
    """Return rotation matrices about an axis, (n, 3, 3).

    Args:
        axis: Unit length, (3,).
        angles: (n,) (rad).
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sin * cross + (1 - cos) * (cross @ cross)


def pose_matrix(position: Sequence[float], quaternion: Sequence[float]) -> Floats:
    """Return a pose as a matrix, (4, 4).

    Args:
        position: (3,) (m).
        quaternion: wxyz, unit length.
    """
    w, x, y, z = quaternion
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = position
    return pose


def read_origin(element: Element, urdf: str) -> Floats:
    """Return the ``<origin>`` of a joint, collision or visual, (4, 4); identity if it has none.

    Raises:
        AssetError: If it does not hold numbers.
    """
    pose = np.eye(4)
    origin = element.find("origin")
    if origin is not None:
        pose[:3, 3] = read_numbers(origin, "xyz", (0.0, 0.0, 0.0), urdf)
        roll, pitch, yaw = read_numbers(origin, "rpy", (0.0, 0.0, 0.0), urdf)
        turns = zip(np.eye(3)[::-1], (yaw, pitch, roll), strict=True)
        for axis, angle in turns:
            pose[:3, :3] = pose[:3, :3] @ turned(axis, np.array([angle]))[0]
    return pose


def read_numbers(element: Element, key: str, default: Sequence[float], urdf: str) -> Floats:
    """Return an attribute that holds as many finite numbers as ``default``.

    Raises:
        AssetError: If it holds something else.
    """
    text = element.get(key)
    if text is None:
        return np.array(default, float)
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.array([math.nan])
    if len(numbers) != len(default) or not np.isfinite(numbers).all():
        raise AssetError(
            f"{urdf}: <{element.tag} {key}={text!r}> should hold {len(default)} finite numbers"
        )
    return numbers


def _read_joints(root: Element, urdf: str) -> list[Joint]:
    joints = [_read_joint(element, urdf) for element in root.iterfind("joint")]
    for kind, names in (
        ("joint", [joint.name for joint in joints]),
        ("link", [link.get("name", "") for link in root.iterfind("link")]),
    ):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise AssetError(f"{urdf} has several {kind}s of one name: {', '.join(twice)}")
    if all(joint.type == FIXED for joint in joints):
        raise AssetError(f"{urdf} has no joint that moves; it is no robot")
    return joints


def _read_joint(element: Element, urdf: str) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in (FIXED, *TURNING, SLIDING):
        choices = ", ".join((FIXED, *TURNING, SLIDING))
        raise AssetError(f"{urdf}: joint {name!r} is {kind!r}; it must be one of {choices}")
    axis = np.array([1.0, 0.0, 0.0])
    if (found := element.find("axis")) is not None:
        axis = read_numbers(found, "xyz", (1.0, 0.0, 0.0), urdf)
    length = float(np.linalg.norm(axis))
    if kind != FIXED and length < 1e-3:
        raise AssetError(f"{urdf}: the axis of joint {name!r} has no direction")
    limit, lower, upper = element.find("limit"), -math.inf, math.inf
    if limit is not None and kind in ("revolute", SLIDING):
        (lower,) = read_numbers(limit, "lower", (0.0,), urdf).tolist()
        (upper,) = read_numbers(limit, "upper", (0.0,), urdf).tolist()
    return Joint(
        name=name,
        type=kind,
        parent=_reference(element, "parent", urdf),
        child=_reference(element, "child", urdf),
        origin=read_origin(element, urdf),
        axis=axis / max(length, 1e-3),
        lower=lower,
        upper=upper,
        follows=_read_mimic(element, urdf),
    )


def _read_mimic(element: Element, urdf: str) -> tuple[str, float, float] | None:
    mimic = element.find("mimic")
    if mimic is None:
        return None
    (multiplier,) = read_numbers(mimic, "multiplier", (1.0,), urdf).tolist()
    (offset,) = read_numbers(mimic, "offset", (0.0,), urdf).tolist()
    return mimic.get("joint", ""), multiplier, offset


def _reference(element: Element, end: str, urdf: str) -> str:
    found = element.find(end)
    if found is None or not found.get("link"):
        raise AssetError(f"{urdf}: joint {element.get('name')!r} has no {end} link")
    return found.get("link", "")


def _root_link(root: Element, joints: Sequence[Joint], urdf: str) -> str:
    links = [link.get("name", "") for link in root.iterfind("link")]
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise AssetError(f"{urdf}: joint {joint.name!r} names a link {link!r} it lacks")
    carried = [joint.child for joint in joints]
    twice = sorted({link for link in carried if carried.count(link) > 1})
    if twice:
        raise AssetError(f"{urdf}: links {', '.join(twice)} hang on several joints")
    roots = [link for link in links if link not in carried]
    if len(roots) != 1:
        found = ", ".join(roots) if roots else "none, as its joints form a circle"
        raise AssetError(f"{urdf} should have one link that hangs on no joint; it has {found}")
    return roots[0]


def _tree(root: Element, joints: Sequence[Joint], urdf: str) -> tuple[Joint, ...]:
    """Return the joints so that each comes after the one that carries its parent link."""

    def below(link: str) -> Iterator[Joint]:
        for joint in joints:
            if joint.parent == link:
                yield joint
                yield from below(joint.child)

    order = tuple(below(_root_link(root, joints, urdf)))
    lost = sorted({joint.name for joint in joints} - {joint.name for joint in order})
    if lost:
        raise AssetError(f"{urdf}: joints {', '.join(lost)} form a circle")
    return order


def _follow(
    joints: Sequence[Joint], driven: Sequence[str], urdf: str
) -> Mapping[str, tuple[int, float, float]]:
    """Say for each joint that moves which driven joint it follows, times what, plus what."""
    moving = {joint.name: joint for joint in joints if joint.type != FIXED}
    missing = [name for name in driven if name not in moving]
    if missing:
        raise DescriptorError(f"{urdf} has no moving joints {missing}; it has {list(moving)}")
    followed = {name: (index, 1.0, 0.0) for index, name in enumerate(driven)}
    for joint in moving.values():
        if joint.name in followed:
            continue
        if joint.follows is None or joint.follows[0] not in driven:
            raise DescriptorError(
                f"{urdf}: joint {joint.name!r} moves, but is in no joint group and mimics no"
                " joint of one"
            )
        leader, multiplier, offset = joint.follows
        followed[joint.name] = (driven.index(leader), multiplier, offset)
    return followed
