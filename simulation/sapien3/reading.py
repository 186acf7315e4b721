"""What is read of worlds, each right after its step, while the processor's caches still hold it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from simulation.backend import Readout, Velocity
from simulation.maths import Floats
from simulation.sapien3.world import BuiltWorld

Result = TypeVar("Result")

_STILL = np.zeros(3, np.float32)


class PoseReader:
    """Reads poses and joints."""

    def __init__(self, worlds: Sequence[BuiltWorld]) -> None:
        """Look up what is asked of each world."""
        self._packers = [world.scene.pack_poses for world in worlds]
        self._robots = [
            [(robot.get_qpos, robot.get_qvel) for robot in world.articulations] for world in worlds
        ]
        self._packed: list[bytes] = []
        self._qpos: list[Floats] = []
        self._qvel: list[Floats] = []
        self._places = _pose_places(len(worlds), len(worlds[0].scene.entities))
        self._order = _declared_order(worlds[0])

    def look(self, env: int) -> None:
        """Read the next world."""
        self._packed.append(self._packers[env]())
        for positions, velocities in self._robots[env]:
            self._qpos.append(positions())
            self._qvel.append(velocities())

    def readout(self) -> Readout:
        """Return what was read of all worlds, and forget it."""
        packed = np.frombuffer(b"".join(self._packed), np.float32)
        qpos, qvel = self._joints(self._qpos), self._joints(self._qvel)
        self._packed, self._qpos, self._qvel = [], [], []
        return Readout(packed[self._places], qpos, qvel)

    def _joints(self, rows: list[Floats]) -> Floats:
        """Return joints of all robots of all worlds as one row for each world."""
        if len(rows) == 1:
            joints = rows[0][None]
        else:
            joints = np.concatenate(rows).reshape(len(self._packers), -1)
        return joints if self._order is None else joints.take(self._order, 1)


class Lookout(ABC, Generic[Result]):
    """Reads what not every task needs: with the step, if it was asked for after the one before."""

    def __init__(self, worlds: int) -> None:
        """Take how many worlds there are."""
        self._everywhere = range(worlds)
        self._asked = self._fresh = False

    def follows(self) -> bool:
        """Return whether to look at each world in the step that begins now."""
        self._fresh, self._asked = self._asked, False
        return self._fresh

    def expire(self) -> None:
        """Note that worlds were changed since they were looked at."""
        self._fresh = False

    def read(self) -> Result:
        """Return it, of all worlds."""
        self._asked = True
        if not self._fresh:
            for env in self._everywhere:
                self.look(env)
        return self.gathered()

    @abstractmethod
    def look(self, env: int) -> None:
        """Read one world."""

    @abstractmethod
    def gathered(self) -> Result:
        """Return what was read of all worlds."""


class BodyVelocities(Lookout[Floats]):
    """Reads velocities of bodies, (K, N, 3); those that physics does not move have none."""

    def __init__(self, worlds: Sequence[BuiltWorld], wanted: Sequence[Velocity]) -> None:
        """Look the bodies up in every world."""
        super().__init__(len(worlds))
        self._getters = [_getters(world, wanted) for world in worlds]
        self._shape = len(wanted), len(worlds), 3
        self._rows: list[Floats] = [_STILL] * (len(wanted) * len(worlds))

    def look(self, env: int) -> None:
        """Read one world."""
        self._rows[env :: len(self._everywhere)] = [get() for get in self._getters[env]]

    def gathered(self) -> Floats:
        """Return what was read of all worlds."""
        return np.concatenate(self._rows).reshape(self._shape)


def _getters(world: BuiltWorld, wanted: Sequence[Velocity]) -> list[Callable[[], Any]]:
    bodies = world.bodies
    return [
        getattr(bodies[name].component, f"get_{kind}_velocity")
        if bodies[name].declared.kind == "dynamic"
        else _still
        for name, kind in wanted
    ]


def _still() -> Floats:
    return _STILL


def _pose_places(worlds: int, frames: int) -> NDArray[np.intp]:
    """Return where each number of the pose table, (F, N, 7), stands in what SAPIEN packs.

    It packs one world after the other, and the quaternion before the position.
    """
    packed = np.arange(worlds * frames * 7).reshape(worlds, frames, 7).swapaxes(0, 1)
    return np.ascontiguousarray(packed[:, :, [4, 5, 6, 0, 1, 2, 3]])


def _declared_order(world: BuiltWorld) -> NDArray[np.intp] | None:
    """Return where each joint of the descriptors stands in SAPIEN's; None if in its own place."""
    order: list[int] = []
    for robot in world.robots.values():
        order += [len(order) + i for i in robot.active_index]
    return None if order == sorted(order) else np.array(order)
