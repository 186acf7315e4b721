"""Control in any mode: actions become positions and velocities that every joint is driven to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.backend import Backend
from robot_layouts.simulation.control.joint_positions import (
    DrivenGroup,
    JointPositionController,
    driven_groups,
)
from robot_layouts.simulation.control.tcp import TcpController
from robot_layouts.simulation.maths import Floats, cos, maximum, minimum, sin, zeros
from robot_layouts.simulation.readout import ReadoutIndex
from robot_layouts.simulation.state import State


class Remembered(NamedTuple):
    """What a joint group was last asked for, which the next action is relative to.

    Attributes:
        robot: Name of the robot in the layout.
        group: Name of the joint group.
        kind: ``"target_qpos"`` or ``"target_pose"``, as native calls them.
        size: How many numbers it is.
    """

    robot: str
    group: str
    kind: str
    size: int


class ModeController:
    """Turns actions into targets of positions and velocities, for robots in any control mode.

    Attributes:
        remembered: What is kept from one step to the next, robot by robot.
        moves: Whether any joint is driven to a velocity.
    """

    def __init__(self, layout: Layout, positions: JointPositionController) -> None:
        """Sort out what is driven in which way.

        Args:
            layout: The robots.
            positions: What drives those joint groups that take positions.
        """
        self._positions = positions
        driven = list(driven_groups(layout))
        self._from_target = np.zeros(positions.dof, bool)
        self._velocity_joints, self._velocity_numbers = _velocities(driven)
        self._bases = [
            (part.joints.start, part.numbers.start) for part in driven if part.group.asks.drive
        ]
        self.moves = len(self._velocity_joints) > 0 or bool(self._bases)
        for part in driven:
            if part.group.target and part.group.asks.positions:
                self._from_target[part.joints] = True
        self._any_target = bool(self._from_target.any())
        self._scale = _scale(driven)
        self._tools = {
            (part.robot, part.name): TcpController(part, layout)
            for part in driven
            if part.group.asks.tcp
        }
        self.targets: Floats = np.zeros((0, positions.dof), np.float32)
        self._kept = [part for part in driven if part.group.target]
        self.remembered = [
            Remembered(
                part.robot,
                part.name,
                "target_pose" if part.group.asks.tcp else "target_qpos",
                7 if part.group.asks.tcp else len(part.group.joints),
            )
            for part in self._kept
        ]

    @staticmethod
    def needed(layout: Layout) -> bool:
        """Return whether a robot takes more than positions that are relative to present ones."""
        groups = (g for p in layout.values() for g in p.robot.action_split.groups.values())
        return any(group.target or group.command != "position" for group in groups)

    def build(self, backend: Backend, index: ReadoutIndex) -> None:
        """Find frames and solvers in worlds that were built."""
        for control in self._tools.values():
            control.build(backend, index)

    def begin(self, state: State, env_ids: Sequence[int]) -> None:
        """Let what is remembered of some worlds be how they are."""
        if len(self.targets) != state.num_envs:
            self.targets = state.joint_positions.copy()
        self.targets[env_ids] = state.joint_positions[env_ids]
        for control in self._tools.values():
            if control.tool.group.target or control.tool.group.approximates:
                control.begin(state, env_ids)

    def command(
        self, action: Floats, state: State, env_ids: Sequence[int]
    ) -> tuple[Floats, Floats | None]:
        """Return what joints are driven to, and remember it.

        Args:
            action: Shape (N, A).
            state: The worlds before the step.
            env_ids: Which worlds are to move; what is returned of others means nothing.

        Returns:
            Positions (rad, m) and velocities (rad/s, m/s), each (N, dof); no velocities if no mode
            asks for any.
        """
        present = state.joint_positions
        base = np.where(self._from_target, self.targets, present) if self._any_target else present
        targets = self._positions.targets(action, base)
        scaled = self._scaled(action)
        for control in self._tools.values():
            for env in env_ids:
                control.drive(action[env], scaled[env], state, env, targets[env])
        if self._any_target:
            self.targets[env_ids] = targets[env_ids]
        return targets, self._velocities(present, scaled) if self.moves else None

    @property
    def shortfalls(self) -> dict[str, Floats]:
        """By arm, how far the last step's joints stay from where it was sent, (N, 2) (m, rad).

        Of arms alone that go as near as they get where a pose cannot be reached.
        """
        return {
            control.arm: control.shortfalls
            for control in self._tools.values()
            if control.tool.group.approximates
        }

    def recall(self) -> list[Floats]:
        """Return the numbers of `remembered`, each (N, size) (rad, m, wxyz)."""
        return [self._rows(part) for part in self._kept]

    def restore(self, which: int, rows: Floats, env_ids: Sequence[int]) -> None:
        """Let some worlds remember other numbers.

        Args:
            which: Which of `remembered`.
            rows: Shape (worlds, size).
            env_ids: Which worlds.
        """
        self._rows(self._kept[which])[env_ids] = rows

    # -- inside ------------------------------------------------------------------------------

    def _scaled(self, action: Floats) -> Floats:
        low, high, centre, half = self._scale
        return centre + half * minimum(maximum(action, low), high)

    def _velocities(self, present: Floats, scaled: Floats) -> Floats:
        """Return the velocities that scaled action numbers ask of all joints, else 0."""
        velocities = zeros(present)
        velocities[:, self._velocity_joints] = scaled[:, self._velocity_numbers]
        for joint, number in self._bases:
            heading, forward = present[:, joint + 2], scaled[:, number]
            velocities[:, joint] = cos(heading) * forward
            velocities[:, joint + 1] = sin(heading) * forward
            velocities[:, joint + 2] = scaled[:, number + 1]
        return velocities

    def _rows(self, part: DrivenGroup) -> Floats:
        """Return a view of what is remembered of a joint group."""
        if not part.group.asks.tcp:
            return self.targets[:, part.joints]
        return self._tools[part.robot, part.name].targets


def _scale(driven: Sequence[DrivenGroup]) -> Floats:
    """Return lowest, highest, centre and half range of every action number, (4, A)."""
    rows: list[tuple[float, float, float, float]] = []
    for part in driven:
        for low, high in part.group.ranges[: part.group.size]:
            low, high = np.float32(low), np.float32(high)
            if part.group.normalised:
                half = np.float32(0.5)
                rows.append((-1.0, 1.0, half * (high + low), half * (high - low)))
            else:
                rows.append((-np.inf, np.inf, 0.0, 1.0))
    return np.array(rows, np.float32).T


def _velocities(driven: Sequence[DrivenGroup]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the joints that are driven to velocities, and the action numbers that say to which."""
    joints: list[int] = []
    numbers: list[int] = []
    for part in driven:
        if part.group.asks.velocities:
            joints += range(part.joints.start, part.joints.stop)
            numbers += range(part.numbers.stop - len(part.group.joints), part.numbers.stop)
    return np.array(joints, np.intp), np.array(numbers, np.intp)
