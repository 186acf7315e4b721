"""What a check of collisions costs, per state and per straight way.

All times are processor time of one core. Beside them stands FCL alone on the same states, with its
`DynamicAABBTreeCollisionManager`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import Floats
from layouts import Layout, Placement, ring
from motion.collision.cell import Cell
from motion.model.bodies import WORLD
from motion.model.link_poses import LinkPoses
from motion.model.obstacles import box

BATCHES = (1, 16, 64)
DEFAULT, FINE = (0.01, 0.05), (0.001, np.pi / 360)  # of edges (m, rad)
NOTE = """\
Times in µs of one core. FCL alone: poses as here, then a DynamicAABBTreeCollisionManager per robot
against those of the others, and a robot's own pairs one by one, all asked from Python; in brackets
without handing over the poses. "pairs": of hulls that count; "to FCL":
how many of them per state the bounds here leave over. Published for four Pandas: about 207 µs per
state for FCL in C++, 15 µs for VAMP-MR (AVX2, spheres instead of the robots' shapes), both on other
machines and other states."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("--states", type=int, default=1024, help="random states per cell (1024)")
    parser.add_argument("--edges", type=int, default=20, help="free edges per cell (20)")


def run(options: argparse.Namespace) -> int:
    """Print both tables."""
    for line in report(options.states, options.edges):
        print(line, flush=True)
    return 0


def report(states: int, edges: int) -> Iterator[str]:
    """Yield the lines of the tables.

    Args:
        states: How many states per cell.
        edges: How many edges per cell.
    """
    yield NOTE
    yield ""
    yield _row("cell", "pairs", "free", *(f"n = {n}" for n in BATCHES), "FCL alone", "to FCL")
    yield _row(*["---"] * (5 + len(BATCHES)))
    made = {name: make() for name, make in CELLS.items()}
    for name, cell in made.items():
        yield _row(name, *_states_row(cell, states))
    yield ""
    yield _row("free edges", "steps of 1 cm", "µs", "steps of 1 mm", "µs", "µs per step")
    yield _row(*["---"] * 6)
    for name, cell in made.items():
        yield _row(name, *_edges_row(cell, edges))


def _pandas(count: int, **more: Any) -> Cell:
    table = more.pop("table", None)
    names = {f"arm_{i}": "panda" for i in range(count)}
    return Cell(ring(names, **more), table=table)


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


def random_states(cell: Cell, count: int) -> Floats:
    """Return states anywhere within the limits, (count, D), the same every time."""
    low, high = np.clip(cell.limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi).T
    return np.random.default_rng(0).uniform(low, high, (count, cell.size))


def _states_row(cell: Cell, count: int) -> Iterator[str]:
    checker, states = cell.checker(), random_states(cell, count)
    free = checker.free(states)
    alone = FclAlone(cell)
    known = alone.free(states)
    if (free != known).any():
        raise AssertionError(f"FCL alone answers otherwise for {np.flatnonzero(free != known)}")
    yield str(len(checker.pairs))
    yield f"{free.mean():.0%}"
    for batch in BATCHES:
        parts = [states[i : i + batch] for i in range(0, count, batch)]
        yield f"{_least(lambda parts=parts: [checker.free(part) for part in parts]) / count:.1f}"
    alone.inside = 0.0
    whole = _least(lambda: alone.free(states), times=1)
    yield f"{whole / count:.0f} ({alone.inside * 1e6 / count:.0f})"
    yield f"{len(checker.candidates(states).states) / count:.2f}"


def _edges_row(cell: Cell, count: int) -> Iterator[str]:
    checker, edges = cell.checker(), list(_free_edges(cell, count))
    per_step = 0.0
    for resolution in (DEFAULT, FINE):
        steps = sum(checker.steps(a, b, resolution) for a, b in edges)
        spent = _least(lambda r=resolution: [checker.edge_free(a, b, r) for a, b in edges])
        yield f"{steps / count:.0f}"
        yield f"{spent / count:.0f}"
        per_step = spent / steps
    yield f"{per_step:.2f}"


def _free_edges(cell: Cell, count: int) -> Iterator[tuple[Floats, Floats]]:
    """Yield free edges of 0.3 rad in each joint or so."""
    checker, random, found = cell.checker(), np.random.default_rng(1), 0
    for start in random_states(cell, 100 * count):
        way = random.normal(0.0, 0.3, cell.size)
        end = np.clip(start + way, *cell.limits.T)
        if found < count and checker.edge_free(start, end):
            found += 1
            yield start, end


def _least(run: Callable[[], object], times: int = 3) -> float:
    """Return the least processor time of some runs (µs)."""
    spent: list[float] = []
    for _ in range(times):
        begun = time.process_time()
        run()
        spent.append(time.process_time() - begun)
    return min(spent) * 1e6


class FclAlone:
    """The same question, put to FCL state by state.

    Each robot's links have a broadphase manager, its base another, tables and obstacles a third
    one. Pairs of a robot's own links are asked one by one, as python-fcl does not tell a callback
    which bodies it is called for.

    Attributes:
        inside: Processor time within FCL's calls so far (s).
    """

    def __init__(self, cell: Cell) -> None:
        """Hand FCL all bodies."""
        import fcl

        self.inside = 0.0
        self._solids, self._chains = cell.solids, LinkPoses(cell, range(len(cell.parts)))
        self._bodies = [fcl.CollisionObject(solid.hull.geometry) for solid in cell.solids]
        self._own = [
            (self._bodies[a], self._bodies[b])
            for a, b in cell.counted_pairs
            if cell.solids[a].mover == cell.solids[b].mover
        ]
        groups: dict[tuple[str, bool], list[Any]] = {}
        for solid, body in zip(cell.solids, self._bodies, strict=True):
            groups.setdefault((solid.mover, solid.part != WORLD), []).append(body)
        self._place(self._chains.places(cell.start[None])[:, 0])
        self._managers = {group: _manager(bodies) for group, bodies in groups.items()}
        self._meeting = [
            (self._managers[one], self._managers[other])
            for one, other in combinations(self._managers, 2)
            if one[0] != other[0] and (one[1] or other[1])
        ]

    def free(self, states: Floats) -> NDArray[np.bool_]:
        """Tell which states are free, (n,)."""
        places = self._chains.places(states)
        return np.array([self._is_free(places[:, i]) for i in range(len(states))], bool)

    def _place(self, places: Floats) -> None:
        for body, solid in zip(self._bodies, self._solids, strict=True):
            pose = places[self._chains.rows[solid.part]] @ solid.offset
            body.setRotation(pose[:3, :3])
            body.setTranslation(pose[:3, 3])

    def _is_free(self, places: Floats) -> bool:
        self._place(places)
        begun = time.process_time()
        for (_, moves), manager in self._managers.items():
            if moves:
                manager.update()
        free = not any(map(self._touch, self._own)) and not any(map(self._meet, self._meeting))
        self.inside += time.process_time() - begun
        return free

    def _touch(self, pair: tuple[Any, Any]) -> bool:
        import fcl

        return fcl.collide(*pair, fcl.CollisionRequest(), fcl.CollisionResult()) > 0

    def _meet(self, managers: tuple[Any, Any]) -> bool:
        import fcl

        found = fcl.CollisionData()
        managers[0].collide(managers[1], found, fcl.defaultCollisionCallback)
        return bool(found.result.is_collision)


def _manager(bodies: Sequence[Any]) -> Any:
    import fcl

    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(bodies)
    manager.setup()
    manager.update()
    return manager


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"
