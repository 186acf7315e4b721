"""What moves each joint group of a task along a motion, in its control mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, inverse, multiply
from robot_layouts.simulation import State
from tasks import TaskEnv
from tasks.driving import DrivenGroup, TcpDrive, VelocityDrive, drive_of

NEAR = 0.005  # rad, m; as near to their end are joints that have arrived
NEAR_TCP = 0.002, 0.01  # m, rad; the same of TCPs, where a control mode drives these
_CORRECTION = 0.7  # of what was missed, in one step
_MEMORY = 0.9  # of what was learnt, from step to step
_SLIGHT = 0.05  # rad/s, m/s; from smaller changes of speed little is learnt


class Aim(NamedTuple):
    """What all joints do in a control step, as the motion has it.

    Attributes:
        here: Where they should be before it, (dof,) (rad, m).
        way: How far they should go, (dof,) (rad, m).
        change: How much their speeds should change, (dof,) (rad/s, m/s).
    """

    here: Floats
    way: Floats
    change: Floats


class MotionDrive:
    """Moves a joint group along a motion.

    A drive pulls by stiffness · way − damping · speed: without inertia it goes a certain share of
    the way. What inertia costs besides grows with the change of speed; how fast, is learnt on the
    way from what earlier steps missed.
    """

    def __init__(self, driven: DrivenGroup, task: TaskEnv, *, moves: bool) -> None:
        """Take the group.

        Args:
            driven: The group.
            task: Of which it is.
            moves: Whether the motion moves it.
        """
        self.numbers, self._joints, self._moves = driven.numbers, driven.joints, moves
        self._drive, self._simulation = drive_of(driven, task), task.simulation
        self._seconds = 1 / task.scenario.control_frequency
        self._by_speed = isinstance(self._drive, VelocityDrive)
        rates = [k / d if d else np.inf for k, d, _ in driven.group.drives]
        shares = 1 - np.exp(-np.array(rates) * self._seconds)
        self._pulls = np.ones_like(shares) if self._by_speed else 1 / shares
        self._bounds = np.full((2, len(driven.group.joints)), [[-np.inf], [np.inf]])
        if driven.group.asks.positions and not driven.group.delta and driven.group.limits:
            self._bounds = np.array(driven.group.limits).T
        self._sums = np.zeros((2, len(shares)))
        self._before: tuple[Floats, Floats] | None = None
        self._pull = np.zeros_like(shares)

    def toward(self, aim: Aim, state: State) -> tuple[Floats, bool]:
        """Return the action numbers of a step, and whether they are within bounds."""
        numbers, within = self._drive.toward(self._target(aim, state), state)
        return numbers, within or not self._moves

    def arrived(self, end: Floats, state: State) -> bool:
        """Return whether the group is where some joints, (dof,), have it."""
        wanted, here = self._drive.target(end, state), self._drive.at(state)
        if not isinstance(self._drive, TcpDrive):
            return bool(np.abs(wanted - here).max() < NEAR)
        turn = 2 * np.arccos(min(1.0, abs(multiply(wanted[3:], inverse(here[3:]))[0])))
        near = np.linalg.norm(wanted[:3] - here[:3]) < NEAR_TCP[0]
        return bool(near and (turn < NEAR_TCP[1] or not self._drive.driven.group.asks.turn))

    def learn(self, state: State) -> None:
        """Compare the step that ended with a state with what it was meant to do."""
        where = state.joint_positions[0, self._joints].astype(float)
        speed = state.joint_velocities[0, self._joints].astype(float)
        if self._before is not None:
            began, earlier = self._before
            pull = self._pull
            if not self._by_speed:
                pull = self._simulation.drive_targets[0, self._joints] - began
            missed = pull / self._pulls - (where - began)
            change = speed - earlier
            self._sums = _MEMORY * self._sums + [missed * change, change**2]
        self._before = where, speed

    def _target(self, aim: Aim, state: State) -> Floats:
        """Return what the drive is driven to so that the group goes as far as it should."""
        here, way, change = (each[self._joints] for each in aim)
        cost = np.maximum(self._sums[0] / (self._sums[1] + _SLIGHT**2), 0.0)
        where = self._drive.at(state)
        if isinstance(self._drive, TcpDrive):
            self._pull = (way + cost * change) * self._pulls
            ahead = aim.here.copy()
            ahead[self._joints] += self._pull
            share = _CORRECTION * float(self._pulls.mean()) - 1
            wanted, now = (self._drive.target(joints, state) for joints in (ahead, aim.here))
            return self._drive.shifted(wanted, now, where, share)
        self._pull = (way + _CORRECTION * (here - where) + cost * change) * self._pulls
        if self._by_speed:
            return self._pull / self._seconds
        return np.clip(where + self._pull, *self._bounds)


def drive_within_bounds(
    drives: Sequence[MotionDrive],
    aim: Callable[[float], Aim],
    state: State,
    action: NDArray[np.float32],
    halvings: int,
) -> float:
    """Write into an action, (A,), what drives go in a step as far as all are within bounds.

    Args:
        drives: What is driven.
        aim: What all joints do in a share of the step, 0 … 1.
        state: The world before the step.
        action: Where their numbers are written.
        halvings: How often the interval in which the share lies is halved.

    Returns:
        The share: 1 if all of the step is within bounds, 0 if none of it is.
    """

    def within(share: float) -> bool:
        wanted, every = aim(share), True
        for drive in drives:
            action[drive.numbers], fits = drive.toward(wanted, state)
            every = every and fits
        return every

    if within(1.0):
        return 1.0
    enough, too_much = 0.0, 1.0
    for _ in range(halvings):
        middle = (enough + too_much) / 2
        enough, too_much = (middle, too_much) if within(middle) else (enough, middle)
    within(enough)
    return enough
