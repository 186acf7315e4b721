"""``python -m benchmarks collisions``: what a check of collisions costs, per state and per edge."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.records import table
from layouts import Layout, Placement, ring
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import box

BATCHES = (1, 16, 64)
RESOLUTIONS = {"1 cm": (0.01, 0.05), "1 mm": (0.001, np.pi / 360)}  # of edges (m, rad)


def collisions(*, states: int = 1024, edges: int = 20) -> int:
    """Print what a check of collisions costs, in µs of one core.

    Args:
        states: Random states per cell.
        edges: Free edges per cell.
    """
    made = {name: make() for name, make in CELLS.items()}
    headings = ("cell", "pairs", "free", *(f"n = {n}" for n in BATCHES), "pairs left by bounds")
    print(table(headings, ((name, *_states_row(cell, states)) for name, cell in made.items())))
    steps = (heading for name in RESOLUTIONS for heading in (f"steps of {name}", "µs"))
    print()
    rows = ((name, *_edges_row(cell, edges)) for name, cell in made.items())
    print(table(("free edges", *steps), rows))
    return 0


def _pandas(count: int, **more: Any) -> Cell:
    floor = more.pop("table", None)
    return Cell(ring({f"arm_{i}": "panda" for i in range(count)}, **more), table=floor)


def _mixed() -> Cell:
    layout = Layout(
        {
            "panda": Placement("panda", (-0.5, 0.0, 0.0)),
            "xarm": Placement("xarm7", (0.5, 0.0, 0.0), rpy=(0.0, 0.0, np.pi)),
            "fetch": Placement("fetch", (0.0, 1.0, 0.0), rpy=(0.0, 0.0, -np.pi / 2)),
            "small": Placement("so100", (0.0, -0.5, 0.0), rpy=(0.0, 0.0, np.pi / 2)),
        }
    )
    return Cell(layout, [box("crate", (0.3, 0.3, 0.2), (0.0, 0.3, 0.1))])


CELLS: dict[str, Callable[[], Cell]] = {
    "2 Pandas": lambda: _pandas(2),
    "4 Pandas": lambda: _pandas(4),
    "4 Pandas, close, table": lambda: _pandas(4, radius=0.6, table=(-1.0, -1.0, 1.0, 1.0)),
    "8 Pandas": lambda: _pandas(8),
    "Panda, xArm7, Fetch, SO-100, box": _mixed,
}


def _random_states(cell: Cell, count: int) -> Floats:
    """Return states anywhere within the limits, (count, D), the same every time."""
    low, high = np.clip(cell.limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi).T
    return np.random.default_rng(0).uniform(low, high, (count, cell.size))


def _states_row(cell: Cell, count: int) -> Iterator[str]:
    checker, states = cell.checker(), _random_states(cell, count)
    yield str(len(checker.pairs))
    yield f"{checker.free(states).mean():.0%}"
    for batch in BATCHES:
        parts = [states[i : i + batch] for i in range(0, count, batch)]
        yield f"{_least(lambda parts=parts: [checker.free(part) for part in parts]) / count:.1f}"
    yield f"{len(checker.candidates(states).states) / count:.2f}"


def _edges_row(cell: Cell, count: int) -> Iterator[str]:
    checker, random = cell.checker(), np.random.default_rng(1)
    edges: list[tuple[Floats, Floats]] = []
    for start in _random_states(cell, 100 * count):
        end = np.clip(start + random.normal(0.0, 0.3, cell.size), *cell.limits.T)  # rad or m
        if len(edges) < count and checker.edge_free(start, end):
            edges.append((start, end))
    for resolution in RESOLUTIONS.values():
        yield f"{sum(checker.steps(a, b, resolution) for a, b in edges) / count:.0f}"
        spent = _least(lambda r=resolution: [checker.edge_free(a, b, r) for a, b in edges])
        yield f"{spent / count:.0f}"


def _least(run: Callable[[], object], times: int = 3) -> float:
    """Return the least processor time of some runs (µs)."""
    spent: list[float] = []
    for _ in range(times):
        begun = time.process_time()
        run()
        spent.append(time.process_time() - begun)
    return min(spent) * 1e6
