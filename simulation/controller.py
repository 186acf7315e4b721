"""Joint-position control, generated from the robots' action splits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from simulation.world import World

Floats = NDArray[np.float32]


class JointPositionController:
    """Turns flat actions into drive targets for every joint of every robot.

    All arithmetic is float32, as in native: float64 targets differ after one step.

    Attributes:
        action_dim: Number of action numbers A of all robots together.
    """

    def __init__(self, layout: Layout, worlds: Sequence[World]) -> None:
        """Lay out the robots' action numbers and joints, one robot after the other."""
        self.action_dim = layout.action_dim
        ranges: list[tuple[float, float]] = []  # of each action number
        clipped: list[float] = []  # where each action number is clipped
        source: list[int] = []  # action number that drives each joint
        relative: list[bool] = []
        active: list[int] = []  # place of each driven joint in the concatenated qpos
        joints_before = 0
        for name, placement in layout.items():
            for group in placement.robot.action_split.groups.values():
                first, count = len(ranges), len(group.joints)
                # One that is not normalised is its own target: 0 + 1 · number.
                ranges.extend(group.ranges if group.normalised else [(-1.0, 1.0)] * group.size)
                clipped.extend([1.0 if group.normalised else np.inf] * group.size)
                source.extend([first] * count if group.mimic else range(first, first + count))
                relative.extend([group.delta] * count)
            robot = worlds[0].robots[name]
            active.extend(joints_before + i for i in robot.active_index)
            joints_before += len(robot.joints)
        low, high = np.array(ranges, np.float32).T
        half = np.float32(0.5)
        self._highest: Floats = np.array(clipped, np.float32)
        self._lowest: Floats = -self._highest
        self._source = np.array(source)
        self._one_to_one = source == list(range(len(ranges)))
        self._centre: Floats = (half * (high + low))[self._source]
        self._half_range: Floats = (half * (high - low))[self._source]
        self._relative = np.array(relative)
        self._active = slice(None) if active == sorted(active) else np.array(active)
        self._setters: list[list[Any]] = [
            [joint.set_drive_target for robot in world.robots.values() for joint in robot.driven]
            for world in worlds
        ]

    def targets(self, action: Floats, qpos: Floats) -> Floats:
        """Return the drive targets of a batch of actions.

        Args:
            action: Shape (N, A); normalised numbers are clipped to [-1, 1].
            qpos: Current joint positions of all robots, shape (N, dof) (rad, m).

        Returns:
            Targets in the order of the robots' driven joints, shape (N, dof) (rad, m).
        """
        clipped = np.minimum(np.maximum(action, self._lowest), self._highest)
        driving = clipped if self._one_to_one else clipped.take(self._source, 1)
        target = self._centre + self._half_range * driving
        np.add(qpos[:, self._active], target, out=target, where=self._relative)
        return target

    def drive(self, targets: Floats, index: int) -> None:
        """Write one world's drive targets to its joints.

        Args:
            targets: What `targets` returned.
            index: Which world.
        """
        for set_target, target in zip(self._setters[index], targets[index].tolist(), strict=True):
            set_target(target)
