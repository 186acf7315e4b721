"""Joint groups that are linkages: their fingers lead, and all other joints go where these are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from robots import JointGroup


class Linkage:
    """The drives of a joint group with leaders; see `robots.JointGroup`.

    Each joint's own target would let those that nothing stops go on alone, so that jaws which hold
    something splay. So before each step of physics leaders are driven at most their lead ahead of
    their mean place, which bounds the force, and the others to where the leaders are and as fast.
    """

    def __init__(self, group: JointGroup, joints: Sequence[Any], articulation: Any) -> None:
        """Take a group, its joints as SAPIEN has them, and what they are joints of."""
        active = articulation.active_joints
        self._articulation, self._lead = articulation, group.lead
        laws = dict(zip(group.joints, zip(joints, group.followers, strict=True), strict=True))
        leading = [laws[name] for name in group.leaders]
        self._places = [active.index(joint) for joint, _ in leading]
        self._multipliers, self._offsets = np.array([law for _, law in leading]).T
        self._leading = [(joint.set_drive_target, *law) for joint, law in leading]
        self._others = [
            (joint.set_drive_target, joint.set_drive_velocity_target, *laws[name][1])
            for name, (joint, _) in laws.items()
            if name not in group.leaders
        ]
        first, (multiplier, offset) = joints[0], group.followers[0]
        self._wanted = (float(first.drive_target[0]) - offset) / multiplier
        self.setters: list[Callable[[float], None]] = [
            partial(self._want, multiplier, offset),
            *[_ignore] * (len(joints) - 1),
        ]

    def pull(self) -> None:
        """Set the targets of all joints for the next step of physics."""
        qpos, qvel = self._articulation.qpos, self._articulation.qvel
        value = float(((qpos[self._places] - self._offsets) / self._multipliers).mean())
        speed = float((qvel[self._places] / self._multipliers).mean())
        ahead = min(max(self._wanted, value - self._lead), value + self._lead)
        for go, multiplier, offset in self._leading:
            go(multiplier * ahead + offset)
        for go, move, multiplier, offset in self._others:
            go(multiplier * value + offset)
            move(multiplier * speed)

    def _want(self, multiplier: float, offset: float, target: float) -> None:
        """Take the target of the group's first joint, which tells that of all."""
        self._wanted = (target - offset) / multiplier


def _ignore(target: float) -> None:
    """Leave a joint's own target aside."""
