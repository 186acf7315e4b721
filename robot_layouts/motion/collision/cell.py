"""A cell: robots of a layout, what is around them or held, and how far all of it keeps apart."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layouts import Layout
from layouts.frames import Rectangle
from robot_layouts.core.bounds import checked_number
from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats, inverse_pose
from robot_layouts.motion.collision.checker import Checker, Flags
from robot_layouts.motion.model.bodies import Bodies, checked_table
from robot_layouts.motion.model.obstacles import Held, Obstacle
from robots import LayoutError, UnknownNameError

LARGEST_CLEARANCE = 1.0  # m


class Cell(Bodies):
    """All robots of a layout, and the bodies around them; what checks of collisions begin with."""

    def checker(
        self,
        moving: Iterable[str] | None = None,
        clearance: float = 0.0,
        own: float | None = 0.0,
        except_: Iterable[tuple[str, str]] = (),
    ) -> Checker:
        """Return what tells whether robots touch each other or anything else.

        Pairs that count: those of each robot's own links that a layout's check looks at; links of
        different robots; links and what is held with tables and obstacles. A table does not count
        against what never moves, such as the base that stands on it, nor does an obstacle that
        does not move either.

        Args:
            moving: The robots that move; only pairs in which one of them, or what it holds, takes
                part are checked. None is all of them.
            clearance: How far bodies have to be apart (m).
            own: How far links of one robot, and what it holds, have to be apart from each other
                (m), which many a robot is built to be by a few millimetres only; None leaves these
                pairs out.
            except_: Pairs that may touch; each a pair of names of `names`.

        Raises:
            LayoutError: If a distance is invalid.
            UnknownNameError: If there is no such robot or body.
        """
        clearance = _distance("clearance", clearance)
        own = None if own is None else _distance("own", own)
        movers = {self.layout.owner(name) for name in (self.robots if moving is None else moving)}
        excepted = [tuple(self._named(name) for name in pair) for pair in except_]
        moves = np.array([solid.mover in movers for solid in self.solids], bool)
        pairs = self.counted_pairs[moves[self.counted_pairs].any(axis=1)]
        counts = np.ones(len(pairs), bool)
        for one, other in excepted:
            first, second = self._are(one)[pairs], self._are(other)[pairs]
            counts &= ~((first & second[:, ::-1]).any(axis=1))
        pairs, is_own = pairs[counts], self._are_own(pairs[counts])
        if own is None:
            return Checker(self, pairs[~is_own], clearance)
        return Checker(self, pairs, np.where(is_own, own, clearance))

    def between_owners(self) -> Checker:
        """Return what measures how near different robots and other bodies come to each other."""
        pairs, solids = self.checker().pairs, self.solids
        apart = [solids[a].owner != solids[b].owner for a, b in pairs.tolist()]
        return Checker(self, pairs[np.array(apart, bool)], 0.0)

    def grasped(self, place: str, obstacle: Obstacle, qpos: ArrayLike | None = None) -> Held:
        """Return a body as it is held by an arm that grasps it where it is.

        Args:
            place: The arm: a robot, or a limb.
            obstacle: The body, at its pose in the world.
            qpos: The coordinates there, (D,) (rad, m); None is the cell's start.

        Raises:
            LayoutError: If the body moves by itself.
            UnknownNameError: If there is no such arm.
        """
        robot, link = self.tcp(place)
        poses = self.poses(np.atleast_2d(self.start if qpos is None else np.asarray(qpos, float)))
        tcp = poses[0, self.links.index((robot, self.models[robot].kinematics.links[link]))]
        if obstacle.moves:
            return Held(place, obstacle)  # says what is wrong
        return Held(place, obstacle.moved(inverse_pose(tcp) @ obstacle.poses(None, 1)[0]))

    def _are_own(self, pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Tell which pairs of solids one robot moves, (m,)."""
        movers = np.array([solid.mover for solid in self.solids])
        return movers[pairs[:, 0]] == movers[pairs[:, 1]]

    def _are(self, name: str) -> NDArray[np.bool_]:
        """Tell which solids a name stands for, (solids,)."""
        return np.array([name in (solid.owner, solid.name) for solid in self.solids], bool)

    def _named(self, name: str) -> str:
        if name not in self.names:
            raise UnknownNameError("body of this cell", name, self.names)
        return name


def cell_of(
    layout: Layout,
    obstacles: Iterable[Obstacle] = (),
    held: Iterable[Held] = (),
    table: Rectangle | None = None,
) -> Cell:
    """Return a cell; the last ones of robots and tables alone are kept."""
    if obstacles or held or not isinstance(layout, Layout):
        return Cell(layout, obstacles, held, table)
    return _plain_cell(layout, checked_table(table))


@lru_cache(maxsize=8)
def _plain_cell(layout: Layout, table: Rectangle | None) -> Cell:
    return Cell(layout, table=table)


def _distance(what: str, value: float) -> float:
    return checked_number(what, value, 0.0, LARGEST_CLEARANCE, LayoutError, "m")


OWN = 5e-4  # m, between links of one robot, so that none grazes another between two looks


class Clearances:
    """The pairs of bodies that count while some robots move, each with its clearance.

    Links of one robot keep `OWN` apart. Bodies that are nearer where a motion begins or ends only
    have to stay apart.
    """

    def __init__(
        self, cell: Cell, robots: Sequence[str], clearance: float, timed: Collection[str] = ()
    ) -> None:
        """Gather the pairs.

        Args:
            cell: The cell.
            robots: Those that move.
            clearance: How far they keep from everything else (m).
            timed: Robots that move along known trajectories; obstacles that do are known.
        """
        self.cell = cell
        self._pairs = cell.checker(robots, 0.0).pairs
        solids = cell.solids
        self._movers = np.array([solid.mover for solid in solids])[self._pairs]
        own = (self._movers[:, 0] == self._movers[:, 1]) & (self._movers[:, 0] != "")
        self._apart = np.where(own, OWN, clearance)
        moved = [s.mover in timed or cell.parts[s.part].track is not None for s in solids]
        self._overlaps: dict[tuple[str, ...], Checker] = {}
        one, other = np.array(moved, bool)[self._pairs].T
        self._timed = one | other

    def expect_free_start(self, start: Floats) -> None:
        """Refuse to begin with an overlap.

        Raises:
            NoPlanError: If something overlaps.
        """
        contact = self.overlaps().contact(start)
        if contact is not None:
            raise NoPlanError(f"at the start {contact}", "start in collision")

    def relax(self, state: Floats, time: float = 0.0) -> None:
        """Let the pairs of bodies that are nearer than the clearance in a state be that near."""
        self._apart[Checker(self.cell, self._pairs, self._apart).close(state, time)] = 0.0

    def overlaps(self, ignored: Collection[str] = ()) -> Checker:
        """Return what tells whether anything overlaps but some robots, which do not count."""
        key = tuple(ignored)
        if key not in self._overlaps:
            kept = ~self._moved_by(ignored)
            self._overlaps[key] = Checker(self.cell, self._pairs[kept], 0.0)
        return self._overlaps[key]

    def checker(
        self, moving: Collection[str], ignored: Collection[str] = (), *, timed: bool = True
    ) -> Checker:
        """Return what tells whether a state is free.

        Args:
            moving: Robots one of which must take part.
            ignored: Robots that do not count.
            timed: Whether what moves along a known trajectory counts.
        """
        chosen = self._moved_by(moving) & ~self._moved_by(ignored)
        return self._checker(chosen if timed else chosen & ~self._timed)

    @property
    def standing(self) -> NDArray[np.intp]:
        """The pairs in which nothing moves along a known trajectory, (m, 2)."""
        return self._pairs[~self._timed]

    def between(self, some: Collection[str], others: Collection[str]) -> Checker:
        """Return what tells whether two groups of robots keep clear of each other."""
        return self._checker(self._moved_by(some) & self._moved_by(others))

    def _moved_by(self, robots: Collection[str]) -> Flags:
        """Tell which pairs some robots take part in."""
        moved = np.isin(self._movers, list(robots))
        return moved[:, 0] | moved[:, 1]

    def _checker(self, chosen: Flags) -> Checker:
        return Checker(self.cell, self._pairs[chosen], self._apart[chosen])
