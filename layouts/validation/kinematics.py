"""Where a robot's links are, for many joint positions at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from robots import DescriptorError, UnknownNameError
from robots.urdf.model import ModelJoint, UrdfModel

Floats = NDArray[np.float64]

SLIDING = "prismatic"


class Kinematics:
    """Forward kinematics of many joint positions at once.

    Attributes:
        driven: The joints whose positions are given, in that order.
        links: Names of all links, parents before children.
        parents: For each link the index of its parent; -1 for the root.
        bodies: For each link the index of the first link that it is rigidly fixed to.
        limits: The (lower, upper) limit of each driven joint, (driven, 2) (rad, m).
    """

    def __init__(self, model: UrdfModel, driven: Sequence[str]) -> None:
        """Take the tree that a URDF describes.

        Args:
            model: Its links and joints.
            driven: Names of the joints that positions are given for; every joint that moves must
                be one of them or mimic one.

        Raises:
            DescriptorError: If a driven joint does not exist, or a joint that moves has no drive.
        """
        self.driven = tuple(driven)
        self._order = model.ordered
        self._origins = [origin_matrix(joint.xyz, joint.rpy) for joint in self._order]
        self.links = (model.root, *(joint.child for joint in self._order))
        self._index = {link: i for i, link in enumerate(self.links)}
        self.parents = (-1, *(self._index[joint.parent] for joint in self._order))
        self._followed = _follow(model, self.driven)
        self.bodies = self._rigid_bodies()
        spans = {joint.name: (joint.lower, joint.upper) for joint in model.moving}
        self.limits = np.array(
            [
                (-math.inf if low is None else low, math.inf if high is None else high)
                for low, high in (spans[name] for name in driven)
            ]
        )

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
            placed = poses[:, self.parents[i]] @ self._origins[i - 1]
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
                axis = poses[:, link, :3, :3] @ np.array(joint.axis)
                if joint.type == SLIDING:
                    sliding[:, column] = axis
                else:
                    turning[:, column] = axis
                    sliding[:, column] = np.cross(poses[:, link, :3, 3], axis)
            link = self.parents[link]
        return turning, sliding

    def _motion(self, joint: ModelJoint, qpos: Floats) -> Floats:
        motion = np.broadcast_to(np.eye(4), (len(qpos), 4, 4)).copy()
        if not joint.moves:
            return motion
        index, multiplier, offset = self._followed[joint.name]
        moved = multiplier * qpos[:, index] + offset
        if joint.type == SLIDING:
            motion[:, :3, 3] = moved[:, None] * np.array(joint.axis)
        else:
            motion[:, :3, :3] = turned(joint.axis, moved)
        return motion

    def _rigid_bodies(self) -> tuple[int, ...]:
        bodies = [0]
        for i, joint in enumerate(self._order, start=1):
            bodies.append(i if joint.moves else bodies[self.parents[i]])
        return tuple(bodies)


def turned(axis: Sequence[float], angles: Floats) -> Floats:
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


def origin_matrix(xyz: Sequence[float], rpy: Sequence[float]) -> Floats:
    """Return a URDF's origin as a matrix, (4, 4).

    Args:
        xyz: Position (m).
        rpy: Turns about the fixed axes x, y, z, in that order (rad).
    """
    pose = np.eye(4)
    for axis, angle in zip(np.eye(3), rpy, strict=True):
        pose[:3, :3] = turned(axis.tolist(), np.array([angle]))[0] @ pose[:3, :3]
    pose[:3, 3] = xyz
    return pose


def _follow(model: UrdfModel, driven: Sequence[str]) -> dict[str, tuple[int, float, float]]:
    """Say for each joint that moves which driven joint it follows, times what, plus what."""
    moving = {joint.name: joint for joint in model.moving}
    missing = [name for name in driven if name not in moving]
    if missing:
        raise DescriptorError(
            f"the URDF of {model.name!r} has no moving joints {missing}; it has {list(moving)}"
        )

    return {name: _followed(joint, moving, driven, model.name) for name, joint in moving.items()}


def _followed(
    joint: ModelJoint, moving: Mapping[str, ModelJoint], driven: Sequence[str], robot: str
) -> tuple[int, float, float]:
    """Return which driven joint a joint follows, times what, plus what."""
    multiplier, offset, at = 1.0, 0.0, joint
    while at.name not in driven:
        if at.mimics is None:
            raise DescriptorError(
                f"joint {at.name!r} of {robot!r} moves, but is in no joint group and mimics no"
                " joint of one"
            )
        offset += multiplier * at.offset
        multiplier *= at.multiplier
        at = moving[at.mimics]
    return driven.index(at.name), multiplier, offset
