"""A robot whose joints stand somewhere: where its links are, for any number of postures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.tree import kinematic_tree


class Stance:
    """Poses of the links of a robot by the positions of its leading joints.

    Attributes:
        model: What its URDF describes.
        tree: Its links; the coordinates are the joints that mimic none.
    """

    def __init__(self, model: UrdfModel) -> None:
        """Take a robot that stands with its joints at 0, or mid-range where 0 is out."""
        self.model = model
        self.leaders = tuple(joint for joint in model.moving if joint.mimics is None)
        self.tree = kinematic_tree(model, [joint.name for joint in self.leaders])
        self.index = {joint.name: i for i, joint in enumerate(self.leaders)}

    @cached_property
    def middle(self) -> Floats:
        """The posture with joints at 0, or mid-range where 0 is out, (leaders,) (rad, m)."""
        return np.array([middle_of(joint) for joint in self.leaders])

    def with_joints(self, positions: Mapping[str, float], posture: Floats | None = None) -> Floats:
        """Return a posture, or the middle one, with some leading joints elsewhere, (leaders,)."""
        changed = (self.middle if posture is None else posture).copy()
        for joint, position in positions.items():
            if joint in self.index:
                changed[self.index[joint]] = position
        return changed

    def poses(self, postures: Floats) -> Floats:
        """Return the poses of all links, (postures, links, 4, 4), in the root's frame (m)."""
        return self.tree.forward(np.atleast_2d(postures))

    def places(self, links: Iterable[str], posture: Floats | None = None) -> Floats:
        """Return the origins of some links in the root's frame, (links, 3) (m)."""
        poses = self.poses(self.middle if posture is None else posture)[0]
        return poses[[self.tree.link(link) for link in links], :3, 3]

    def all_joints(self, posture: Floats) -> dict[str, float]:
        """Return the positions of all joints, also of those that mimic (rad, m)."""
        return {joint.name: self._position(joint, posture) for joint in self.model.moving}

    def _position(self, joint: ModelJoint, posture: Floats) -> float:
        link = self.tree.link(joint.child)
        at = posture[self.tree.drivers[link]]
        value = float(self.tree.multipliers[link] * at + self.tree.offsets[link])
        low, high = joint.span
        return round(min(max(value, low), high), 6)


def middle_of(joint: ModelJoint) -> float:
    """Return 0, or the middle of a joint's range where 0 is out (rad, m)."""
    low, high = joint.span
    return 0.0 if low <= 0.0 <= high else round((low + high) / 2, 6)
