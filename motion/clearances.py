"""Which bodies have to keep how far from each other while some robots move."""

from __future__ import annotations

from collections.abc import Sequence

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

    def __init__(
        self,
        cell: Cell,
        robots: Sequence[str],
        clearance: float,
        ignored: Sequence[str] = (),
    ) -> None:
        """Gather the pairs.

        Args:
            cell: The cell.
            robots: Those that move.
            clearance: How far they keep from everything else (m).
            ignored: Other robots that do not count.
        """
        self.cell, self.robots, self.clearance = cell, tuple(robots), clearance
        except_ = [(name, other) for name in robots for other in ignored]
        self._whole = cell.checker(robots, 0.0, except_)
        solids = cell.solids
        self._close: NDArray[np.bool_] = np.array(
            [solids[a].owner == solids[b].owner for a, b in self._whole.pairs.tolist()], bool
        ) | (clearance <= 0.0)

    def free(self, states: Floats) -> NDArray[np.bool_]:
        """Tell in which states nothing overlaps, (n,)."""
        return self._whole.free(states)

    def contact(self, state: Floats) -> Contact | None:
        """Return what overlaps most, or None."""
        return self._whole.contact(state)

    def only(self, robot: str, others: Sequence[str]) -> Keeping:
        """Return what one of the robots has to keep from, without some others."""
        return Keeping(self.cell, (robot,), self.clearance, others)

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

    def checkers(self) -> list[Checker]:
        """Return what must agree that a state is free."""
        parts = (np.flatnonzero(self._close), 0.0), (np.flatnonzero(~self._close), self.clearance)
        return [self._checker(pairs, clearance) for pairs, clearance in parts if len(pairs)]

    def _checker(self, pairs: NDArray[np.intp], clearance: float) -> Checker:
        return Checker(self.cell, self._whole.pairs[pairs], clearance)
