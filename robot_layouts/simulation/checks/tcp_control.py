"""Tries control of a robot's TCPs: whether they stay where they are, and follow a square."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from layouts import single
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    multiply,
    rotate,
    xyz_angles,
)
from robot_layouts.simulation.checks.trial import NAME, RobotAlone
from robots import JointGroup, RobotDescriptor

MODES = ("pd_ee_delta_pose", "pd_ee_target_delta_pose", "pd_ee_pose")
ERROR = 2e-3  # m; a TCP may be so far from where it was sent without anything being reported
SIDE = 0.1  # of the square (m)

_HELD = 40  # steps
_CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))  # to the arm's own side, and upward
_ON_A_SIDE, _IN_A_CORNER = 20, 20  # steps


class TcpTrial(NamedTuple):
    """How an arm's TCP went where a control mode sent it.

    Attributes:
        arm: The robot, or the limb, by its name in the layout.
        mode: The control mode.
        drift: How far the TCP went from its start under an action that holds it (m).
        corner: How far it stayed from that corner of a square of which most went unreported (m).
        reported: How far the mode said that it would stay (m); 0 if it reports nothing.
        turn_reported: By how much it gave up the orientation in some corner, at most (rad).
    """

    arm: str
    mode: str
    drift: float
    corner: float
    reported: float
    turn_reported: float

    @property
    def problem(self) -> str | None:
        """What is wrong, or None."""
        if not self.drift < ERROR:
            return f"{self.mode} moves {self.arm} by {self.drift * 1e3:.3g} mm while it is held"
        if not self.corner - self.reported < ERROR:
            return (
                f"{self.mode} misses a corner of a square by {self.corner * 1e3:.3g} mm with"
                f" {self.arm}, and reports {self.reported * 1e3:.3g} mm"
            )
        return None


def try_tcp_control(
    robot: RobotDescriptor, modes: Sequence[str] = MODES, side: float = SIDE
) -> Iterator[TcpTrial]:
    """Hold each TCP of a robot, and send it along an upright square that begins where it is.

    Args:
        robot: The robot.
        modes: Control modes of the TCP.
        side: Of the square (m).

    Yields:
        What was seen of each arm in each mode.

    Raises:
        DescriptorError: If it has no arm whose TCP could be moved.
        RobotLayoutsError: If it cannot be built.
    """
    for arm in single({NAME: robot}).places.values():
        for mode in modes:
            square = _Square(robot, arm, mode)
            yield TcpTrial(arm, mode, square.hold(), *square.follow(side))


class _Square:
    """An arm of a robot alone, whose TCP is driven."""

    def __init__(self, robot: RobotDescriptor, arm: str, mode: str) -> None:
        layout = single({NAME: robot}).in_control_mode({arm: mode})
        self._alone, self._arm, self._mode = RobotAlone(layout), arm, mode
        robot = layout[NAME].robot
        limb = robot.limbs.get(arm.rpartition(".")[2])
        self._own_side = -1.0 if limb is not None and limb.base[1] < 0 else 1.0
        groups = layout.arm(arm).robot.action_split.groups
        (name,) = (name for name, group in groups.items() if group.asks.tcp)
        self._group: JointGroup = groups[name]
        self._numbers = robot.action_split[name]
        self._still = self._alone.numbers_for(self._alone.start)
        self._start = self._pose()
        self._sent = self._start[:3]

    def hold(self) -> float:
        """Hold the TCP; return how far it went at most (m)."""
        drifts = [0.0]
        for _ in range(_HELD):
            action = self._still.copy()
            action[self._numbers] = 0.0 if self._group.delta else self._absolute(self._start)
            self._alone.step(action)
            drifts.append(self._away(self._start))
        return float(np.nan_to_num(drifts, nan=np.inf).max())

    def follow(self, side: float) -> tuple[float, float, float]:
        """Send the TCP along a square; return what it missed most, and what was reported there.

        Args:
            side: Of the square (m).
        """
        out = self._start[:2] - self._root()[:2]
        length = float(np.linalg.norm(out))
        left = np.array((-out[1], out[0], 0.0)) / length if length > ERROR else np.eye(3)[1]
        corners: list[tuple[float, float, float]] = []
        here = self._start
        for corner in np.array(_CORNERS[1:]) @ [self._own_side * left, np.eye(3)[2]]:
            there = self._start.copy()
            there[:3] += side * corner
            for step in range(1, _ON_A_SIDE + _IN_A_CORNER + 1):
                self._send(here + min(step / _ON_A_SIDE, 1.0) * (there - here))
            corners.append((self._away(there), *self._reported()))
            here = there
        seen = np.nan_to_num(corners, nan=np.inf)
        corner, reported, _ = seen[(seen[:, 0] - seen[:, 1]).argmax()].tolist()
        return corner, reported, float(seen[:, 2].max())

    def _send(self, goal: Floats) -> None:
        action = self._still.copy()
        if self._group.delta:
            before = self._sent if self._group.target else self._pose()[:3]
            way = rotate(inverse(self._root()[3:]), goal[:3] - before)
            largest = np.array(self._group.ranges)[:3, 1]
            numbers = np.zeros(self._group.size)
            numbers[:3] = np.clip(way / largest, -1, 1)
            action[self._numbers] = numbers
        else:
            action[self._numbers] = self._absolute(goal)
        self._sent = goal[:3]
        self._alone.step(action)

    def _absolute(self, goal: Floats) -> Floats:
        root = self._root()
        back = inverse(root[3:])
        place, turn = rotate(back, goal[:3] - root[:3]), multiply(back, goal[3:])
        return np.concatenate([place, xyz_angles(turn)])

    def _away(self, goal: Floats) -> float:
        return float(np.linalg.norm(goal[:3] - self._pose()[:3]))

    def _pose(self) -> Floats:
        return self._alone.simulation.read().tcp_pose(self._arm)[0].astype(float)

    def _root(self) -> Floats:
        state, link = self._alone.simulation.read(), self._group.root_link
        pose = state.base_pose(NAME) if link is None else state.link_pose(NAME, link)
        return pose[0].astype(float)

    def _reported(self) -> tuple[float, float]:
        modes = self._alone.simulation.modes
        shortfalls = {} if modes is None else modes.shortfalls
        place, turn = shortfalls[self._arm][0].tolist() if self._arm in shortfalls else (0.0, 0.0)
        return place, turn
