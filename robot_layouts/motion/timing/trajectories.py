"""Trajectories of a cell's coordinates, and the earliest start that collides with none of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import Track
from robot_layouts.motion.timed_motion import hermite, hermite_slopes
from robot_layouts.motion.timing.velocities import STEP


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Some coordinates of a cell over time; they stand still before and behind.

    Attributes:
        columns: Indices of the coordinates, (d,).
        times: Of the knots, increasing, (T,) (s).
        positions: There, (T, d) (rad, m).
        velocities: There, (T, d) (rad/s, m/s).
    """

    columns: NDArray[np.intp]
    times: Floats
    positions: Floats
    velocities: Floats

    @property
    def end(self) -> float:
        """When it ends (s)."""
        return float(self.times[-1])

    def later(self, delay: float) -> JointTrajectory:
        """Return the same, some time later (s)."""
        return replace(self, times=self.times + delay)


@dataclass(frozen=True, eq=False)
class CellTrajectory:
    """All coordinates of a cell over time.

    Attributes:
        cell: The cell.
        base: Where the coordinates are that no trajectory moves, (D,) (rad, m).
        trajectories: Those that are moved.
    """

    cell: Cell
    base: Floats
    trajectories: tuple[JointTrajectory, ...] = ()

    @property
    def end(self) -> float:
        """When everything stands still (s): trajectories, and obstacles on their tracks."""
        tracks = [o.pose.times[-1] for o in self.cell.obstacles if isinstance(o.pose, Track)]
        return float(max([0.0, *tracks, *(trajectory.end for trajectory in self.trajectories)]))

    def with_trajectory(self, trajectory: JointTrajectory) -> CellTrajectory:
        """Return the same with another trajectory."""
        return replace(self, trajectories=(*self.trajectories, trajectory))

    def positions(self, times: ArrayLike) -> Floats:
        """Return all coordinates at some times, (…, D) (rad, m)."""
        states = np.tile(self.base, (*np.shape(times), 1))
        for c in self.trajectories:
            states[..., c.columns] = hermite(c.times, c.positions, c.velocities, times)
        return states

    def velocities(self, times: ArrayLike) -> Floats:
        """Return how fast all coordinates move at some times, (…, D) (rad/s, m/s)."""
        speeds = np.zeros((*np.shape(times), len(self.base)))
        for c in self.trajectories:
            speeds[..., c.columns] = hermite_slopes(c.times, c.positions, c.velocities, times)
        return speeds

    def knots(self) -> Floats:
        """Return times from 0 to the end or a little later, `STEP` apart, (T,) (s).

        What was planned has its knots there, too.
        """
        count = max(int(np.ceil(self.end / STEP - 1e-6)), 1)
        return np.arange(count + 1.0) * STEP
