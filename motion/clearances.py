"""Which bodies have to keep how far from each other while some robots move."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import Floats
from motion.cell import Cell
from motion.collisions import Checker, Contact
from robots.common.errors import NoPlanError


class Keeping:
    """The pairs of bodies that count while some robots move, each with its clearance.

    Links of one robot only have to stay apart; so do bodies that are nearer than the clearance
    where a motion begins or ends.
    """

    def __init__(self, cell: Cell, robots: Sequence[str], clearance: float) -> None:
        """Gather the pairs.

        Args:
            cell: The cell.
            robots: Those that move.
            clearance: How far they keep from everything else (m).
        """
        self.cell, self.clearance = cell, clearance
        self._whole = cell.checker(robots, 0.0)
        self._pairs = self._whole.pairs
        owners = np.array([solid.owner for solid in cell.solids])[self._pairs]
        self._movers = np.array([solid.mover for solid in cell.solids])[self._pairs]
        self._close = (owners[:, 0] == owners[:, 1]) | (clearance <= 0.0)

    def free(self, states: Floats) -> NDArray[np.bool_]:
        """Tell in which states nothing overlaps, (n,)."""
        return self._whole.free(states)

    def contact(self, state: Floats) -> Contact | None:
        """Return what overlaps most, or None."""
        return self._whole.contact(state)

    def without(self, ignored: Collection[str]) -> Checker:
        """Return what tells whether anything overlaps but some robots, which do not count."""
        kept = ~np.isin(self._movers, list(ignored)).any(axis=1)
        return Checker(self.cell, self._pairs[kept], 0.0)

    def expect_free_start(self, start: Floats) -> None:
        """Refuse to begin with an overlap.

        Raises:
            NoPlanError: If something overlaps.
        """
        contact = self.contact(start)
        if contact is not None:
            raise NoPlanError(f"at the start {contact}", "start in collision")

    def relax(self, state: Floats) -> None:
        """Let the pairs of bodies that are nearer than the clearance in a state be that near."""
        far = np.flatnonzero(~self._close)
        if not len(far) or self._checker(far, self.clearance).free(state[None])[0]:
            return
        for pair in far.tolist():
            near = not self._checker(np.array([pair]), self.clearance).free(state[None])[0]
            self._close[pair] = near

    def checkers(
        self, moving: Collection[str] | None = None, ignored: Collection[str] = ()
    ) -> list[Checker]:
        """Return what must agree that a state is free.

        Args:
            moving: Robots one of which must take part; None is all that move.
            ignored: Robots that do not count.
        """
        chosen = ~np.isin(self._movers, list(ignored)).any(axis=1)
        if moving is not None:
            chosen &= np.isin(self._movers, list(moving)).any(axis=1)
        return self._chosen(chosen)

    def checkers_between(self, some: Collection[str], others: Collection[str]) -> list[Checker]:
        """Return what must agree that two groups of robots keep clear of each other."""
        one, other = np.isin(self._movers, list(some)), np.isin(self._movers, list(others))
        chosen = np.asarray(one & other[:, ::-1]).any(axis=1)
        return self._chosen(chosen)

    def _chosen(self, chosen: NDArray[np.bool_]) -> list[Checker]:
        parts = (chosen & self._close, 0.0), (chosen & ~self._close, self.clearance)
        return [
            self._checker(np.flatnonzero(pairs), clearance)
            for pairs, clearance in parts
            if pairs.any()
        ]

    def _checker(self, pairs: NDArray[np.intp], clearance: float) -> Checker:
        return Checker(self.cell, self._pairs[pairs], clearance)
