"""Which bodies have to keep how far from each other while some robots move."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.collision.checker import Checker, Flags

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
