"""What moves each joint group of a task along a motion, in its control mode."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from kinematics.rotations import Floats, inverse, multiply
from simulation import State
from tasks import MultiRobotTask
from tasks.driving import DrivenGroup, JointNumbers, TcpNumbers, further

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

    def of(self, joints: slice) -> Aim:
        """Return what some joints do."""
        return Aim(self.here[joints], self.way[joints], self.change[joints])


class Drive(Protocol):
    """Moves a joint group along a motion."""

    numbers: slice

    def towards(self, aim: Aim, state: State) -> tuple[Floats | float, bool]:
        """Return the numbers of a step, and whether they are within bounds."""
        ...

    def arrived(self, end: Floats, state: State) -> bool:
        """Return whether the group is where some joints, (dof,), have it."""
        ...

    def learn(self, state: State) -> None:
        """See what came of the step that ended with a state."""
        ...


class Constant:
    """A group whose numbers stay the same."""

    def __init__(self, driven: DrivenGroup, number: float) -> None:
        """Take the group."""
        self.numbers, self._number = driven.numbers, number

    def towards(self, aim: Aim, state: State) -> tuple[Floats | float, bool]:
        """See `Drive`."""
        return self._number, True

    def arrived(self, end: Floats, state: State) -> bool:
        """See `Drive`."""
        return True

    def learn(self, state: State) -> None:
        """See `Drive`."""


class JointDrive:
    """A group that is driven by positions of its joints, or by their velocities."""

    def __init__(
        self, driven: DrivenGroup, task: MultiRobotTask, seconds: float, *, moves: bool
    ) -> None:
        """Take the group.

        Args:
            driven: The group.
            task: Of which it is.
            seconds: Of a control step (s).
            moves: Whether the motion moves it.
        """
        self.numbers, self._joints, self._moves = driven.numbers, driven.joints, moves
        self._numbers, self._lag = JointNumbers(driven, task), _Lag(driven, task, seconds)
        self._seconds = seconds
        self._bounds = np.full((2, len(driven.group.joints)), [[-np.inf], [np.inf]])
        if driven.group.asks.positions and not driven.group.delta and driven.group.limits:
            self._bounds = np.array(driven.group.limits).T
        self.learn = self._lag.learn

    def towards(self, aim: Aim, state: State) -> tuple[Floats | float, bool]:
        """See `Drive`."""
        here, way, change = aim.of(self._joints)
        where = self._numbers.where(state)
        pull = self._lag.pulled(way + _CORRECTION * (here - where), change)
        wanted = np.clip(where + pull, *self._bounds)
        if self._numbers.by_speed:
            wanted = pull / self._seconds
        numbers, within = self._numbers.towards(wanted, state)
        return numbers, within or not self._moves

    def arrived(self, end: Floats, state: State) -> bool:
        """See `Drive`."""
        return bool(np.abs(end[self._joints] - self._numbers.where(state)).max() < NEAR)


class TcpDrive:
    """A group that is driven by where its TCP is."""

    def __init__(
        self, driven: DrivenGroup, task: MultiRobotTask, seconds: float, *, moves: bool
    ) -> None:
        """Take the group.

        Args:
            driven: The group.
            task: Of which it is.
            seconds: Of a control step (s).
            moves: Whether the motion moves it.
        """
        self.numbers, self._joints, self._moves = driven.numbers, driven.joints, moves
        self._turns = driven.group.asks.turn
        self._numbers, self._lag = TcpNumbers(driven, task), _Lag(driven, task, seconds)
        self._share = _CORRECTION * float(self._lag.pulls.mean()) - 1
        self.learn = self._lag.learn

    def towards(self, aim: Aim, state: State) -> tuple[Floats | float, bool]:
        """See `Drive`."""
        _, way, change = aim.of(self._joints)
        ahead = aim.here.copy()
        ahead[self._joints] += self._lag.pulled(way, change)
        wanted, here = (self._numbers.pose(joints, state) for joints in (ahead, aim.here))
        pulled = further(wanted, here, self._numbers.where(state), self._share)
        numbers, within = self._numbers.towards(pulled, state)
        return numbers, within or not self._moves

    def arrived(self, end: Floats, state: State) -> bool:
        """See `Drive`."""
        wanted, here = self._numbers.pose(end, state), self._numbers.where(state)
        turn = 2 * np.arccos(min(1.0, abs(multiply(wanted[3:], inverse(here[3:]))[0])))
        near = np.linalg.norm(wanted[:3] - here[:3]) < NEAR_TCP[0]
        return bool(near and (turn < NEAR_TCP[1] or not self._turns))


class _Lag:
    """How far the joints of a group have to be pulled to go some way in a control step.

    A drive pulls by stiffness · way − damping · speed: without inertia it goes a certain share of
    the way. What inertia costs besides grows with the change of speed; how fast, is learnt on the
    way from what earlier steps missed.
    """

    def __init__(self, driven: DrivenGroup, task: MultiRobotTask, seconds: float) -> None:
        self._joints, self._simulation = driven.joints, task.simulation
        self._by_speed = driven.group.asks.velocities and not driven.group.asks.positions
        rates = [k / d if d else np.inf for k, d, _ in driven.group.drives]
        shares = 1 - np.exp(-np.array(rates) * seconds)
        self.pulls = np.ones_like(shares) if self._by_speed else 1 / shares
        self._sums = np.zeros((2, len(shares)))
        self._before: tuple[Floats, Floats] | None = None
        self._pull = np.zeros_like(shares)

    def pulled(self, way: Floats, change: Floats) -> Floats:
        """Return how far, (n,) (rad, m).

        Args:
            way: How far the joints shall go, (n,) (rad, m).
            change: Of their speeds meanwhile, (n,) (rad/s, m/s).
        """
        cost = np.maximum(self._sums[0] / (self._sums[1] + _SLIGHT**2), 0.0)
        self._pull = (way + cost * change) * self.pulls
        return self._pull

    def learn(self, state: State) -> None:
        """See what came of the step that ended with a state."""
        where = state.joint_positions[0, self._joints].astype(float)
        speed = state.joint_velocities[0, self._joints].astype(float)
        if self._before is not None:
            began, earlier = self._before
            pull = self._pull
            if not self._by_speed:
                pull = self._simulation.drive_targets[0, self._joints] - began
            missed = pull / self.pulls - (where - began)
            change = speed - earlier
            self._sums = _MEMORY * self._sums + [missed * change, change**2]
        self._before = where, speed
