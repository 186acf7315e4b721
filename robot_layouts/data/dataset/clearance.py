"""How near different robots came to each other in recorded episodes.

Distances are those of the convex hulls of collision shapes, whatever the simulation lets overlap;
see `robot_layouts.simulation.World`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from layouts import Layout, Placement
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.reading.recording import Recording
from tasks import TaskEnv
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
    task: TaskEnv,
    places: Sequence[int],
    progress: Callable[[], None] = lambda: None,
) -> Clearances | None:
    """Return how near robots came; None if there is one alone, or an episode has no states.

    Args:
        file: The recording.
        task: Its task.
        places: Which episodes are measured, by their place in the recording.
        progress: Called after each episode.

    Raises:
        MissingPackageError: If python-fcl is not installed.
    """
    if len(task.layout) < 2:
        return None
    layout, reader, keys = task.layout, ColumnReader(task), articulation_keys(task.layout)
    least = list[float]()
    standing, distance = None, None  # where robots stood in the last episode, and what measures
    for place in places:
        trajectory = file[place]
        if trajectory.states is None:
            return None
        columns = reader.read(trajectory)
        rows = columns.states["articulations"]
        poses = tuple(tuple(rows[keys[name]][0, :7].tolist()) for name in layout)
        if distance is None or poses != standing:
            standing, distance = poses, _between_robots(_moved(layout, poses))
        qpos = np.concatenate([columns.qpos[name] for name in layout], axis=1)
        least.append(float(distance(qpos.astype(float)).min()))
        progress()
    return Clearances(list(places), np.array(least))


def _moved(layout: Layout, poses: Sequence[Sequence[float]]) -> Layout:
    """Return a layout with robots at other poses, each (x, y, z, w, i, j, k) (m)."""
    moved: dict[str, Placement] = {}
    for (name, placement), pose in zip(layout.items(), poses, strict=True):
        x, y, z = pose[:3]
        w, i, j, k = (np.array(pose[3:]) / np.linalg.norm(pose[3:])).tolist()
        there = {"position": (x, y, z), "quaternion": (w, i, j, k)}
        moved[name] = replace(placement, **there, rpy=None, on=None)
    return Layout(moved)


def _between_robots(layout: Layout) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return what gives the least distance of links of different robots, (n, D) → (n,) (m)."""
    from robot_layouts.motion.collision.cell import Cell
    from robot_layouts.motion.collision.checker import Checker

    cell = Cell(layout)
    movers = np.array([solid.mover for solid in cell.solids])[cell.counted_pairs]
    between = (movers != "").all(axis=1) & (movers[:, 0] != movers[:, 1])
    pairs = cell.counted_pairs[between]
    return Checker(cell, pairs, np.zeros(len(pairs))).distance
