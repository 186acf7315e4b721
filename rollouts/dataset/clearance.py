"""How near different robots came to each other in recorded episodes.

Distances are those of the convex hulls of collision shapes, whatever the simulation lets overlap;
see `simulation.World`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from layouts import Layout, Placement
from rollouts.export.columns import ColumnReader, Columns
from rollouts.reading.recording import Recording, Trajectory
from tasks import MultiRobotTask
from tasks.native.format import articulation_keys


@dataclass(frozen=True)
class Clearances:
    """How near robots came in some episodes.

    Attributes:
        places: Which episodes, by their place in the recording.
        least: The least distance of links of different robots in each (m), of all control steps;
            negative where they overlap.
    """

    places: list[int]
    least: NDArray[np.float64]


def measure(
    file: Recording,
    task: MultiRobotTask,
    places: Sequence[int],
    progress: Callable[[], None] = lambda: None,
) -> Clearances | None:
    """Return how near robots came; None if there is one alone, or an episode has no states.

    Args:
        file: The recording.
        task: Its task.
        places: Which episodes are looked at, by their place in the recording.
        progress: Called after each episode.

    Raises:
        MissingPackageError: If python-fcl is not installed.
    """
    if len(task.layout) < 2:
        return None
    meter, least = _Meter(task), list[float]()
    for place in places:
        trajectory = file[place]
        if trajectory.states is None:
            return None
        least.append(meter.least(trajectory))
        progress()
    return Clearances(list(places), np.array(least))


class _Meter:
    """Measures distances of robots where their bases stood in an episode."""

    def __init__(self, task: MultiRobotTask) -> None:
        self._layout, self._reader = task.layout, ColumnReader(task)
        self._keys = articulation_keys(task.layout)
        self._standing: tuple[tuple[float, ...], ...] = ()
        self._distance: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None

    def least(self, trajectory: Trajectory) -> float:
        columns = self._reader.read(trajectory)
        states = np.concatenate([columns.qpos[name] for name in self._layout], axis=1)
        return float(self._distances(columns)(states.astype(float)).min())

    def _distances(self, columns: Columns) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """Return what measures where robots stand in an episode; mostly that of the last one."""
        rows = columns.states["articulations"]
        standing = tuple(tuple(rows[self._keys[name]][0, :7].tolist()) for name in self._layout)
        if self._distance is None or standing != self._standing:
            self._standing, self._distance = standing, _between_robots(self._moved(standing))
        return self._distance

    def _moved(self, standing: Sequence[Sequence[float]]) -> Layout:
        """Return the layout with robots where they stood, which may have been varied."""
        moved: dict[str, Placement] = {}
        for (name, placement), pose in zip(self._layout.items(), standing, strict=True):
            x, y, z = pose[:3]
            w, i, j, k = (np.array(pose[3:]) / np.linalg.norm(pose[3:])).tolist()
            there = {"position": (x, y, z), "quaternion": (w, i, j, k)}
            moved[name] = replace(placement, **there, rpy=None, on=None)
        return Layout(moved)


def _between_robots(layout: Layout) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return what gives the least distance of links of different robots, (n, D) → (n,) (m)."""
    from motion.cell import Cell
    from motion.collisions import Checker

    cell = Cell(layout)
    movers = np.array([solid.mover for solid in cell.solids])[cell.counted_pairs]
    between = (movers != "").all(axis=1) & (movers[:, 0] != movers[:, 1])
    pairs = cell.counted_pairs[between]
    return Checker(cell, pairs, np.zeros(len(pairs))).distance
