"""One limb as the search for a posture sees it: only the links on the way to its TCP."""

from __future__ import annotations

import numpy as np

from kinematics.rotations import Floats
from robots.guessing.anatomy import Limb
from robots.guessing.stance import Stance
from robots.guessing.tool import Tool

MARGIN = 0.1  # of a joint's range, which it stays away from its ends


class View:
    """One limb: where its joints may be, and where they bring its TCP.

    Attributes:
        free: Indices of its joints among the leading ones.
        limits: Lower and upper limits of those, (2, free) (rad, m).
        room: The same without the margin at the ends.
        bounded: Whether each of them turns less than a whole turn, or slides.
        slides: Whether each of them slides.
        reach: How far the TCP gets from the shoulder (m).
        shoulder: Where the first of them is, (3,) (m).
        moving: Indices of the links that move, in the smaller tree.
        links: Indices of all links that it moves, in the robot's tree.
    """

    def __init__(self, stance: Stance, limb: Limb, tool: Tool) -> None:
        """Take a limb with a joint of its own, and its tool centre point."""
        joints = [joint for joint in limb.arm if joint.mimics is None]
        self.free = [stance.index[joint.name] for joint in joints]
        spans = np.array([joint.span for joint in joints]).T
        self.bounded = spans[1] - spans[0] < 2 * np.pi - 0.1
        half = np.where(self.bounded, (spans[1] - spans[0]) / 2, np.pi)
        middle = np.where(self.bounded, spans.mean(axis=0), np.clip(0.0, *spans))
        self.limits = np.array([middle - half, middle + half])
        self.slides = np.array([joint.unit == "m" for joint in joints])
        margin = 1.5 * MARGIN * half * 2
        self.room = self.limits + np.array([margin, -margin])
        links = [*tool.on(stance.tree).needed, stance.tree.link(limb.palm)]
        self._tree = stance.tree.towards(links)
        self._tcp = tool.on(self._tree)
        self._palm = self._tree.link(limb.palm)
        first = self._tree.link(joints[0].child)
        pose = stance.poses(stance.middle)[0, stance.tree.link(joints[0].child)]
        self.shoulder: Floats = pose[:3, 3]
        axis = pose[:3, :3] @ self._tree.axes[first]
        self.is_upright = abs(axis[2]) > 0.9 and not self._tree.slides[first]
        self.moving = [i for i in range(len(self._tree.links)) if i > first]
        self.links = frozenset(
            stance.tree.link(link)
            for joint in stance.model.below(joints[0])
            for link in stance.model.rigid_with(joint.child)
        )
        self.reach = 1.0

    def look(self, postures: Floats) -> tuple[Floats, Floats]:
        """Return the poses of the limb's links, and the TCP from the shoulder (postures, 3)."""
        poses = self._tree.forward(postures)
        return poses, self._tcp.places(poses) - self.shoulder

    def places(self, postures: Floats) -> Floats:
        """Return the TCP from the shoulder, (postures, 3) (m)."""
        return self.look(postures)[1]

    def pointing(self, poses: Floats) -> Floats:
        """Return which way the tool points, seen from the palm, (postures, 3); 0 if nowhere."""
        way = self._tcp.places(poses) - poses[:, self._palm, :3, 3]
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return np.where(length > 0.01, way / np.maximum(length, 1e-9), 0.0)
