"""The space that a search moves in: some coordinates of a cell, the others stay where they are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.timing.paths import Path

if TYPE_CHECKING:
    from robot_layouts.motion.collision.cell import Cell
    from robot_layouts.motion.collision.checker import Checker
    from robot_layouts.motion.planning.infeasibility import InfeasibilityProofs

PIECES = 6  # straight ones, in which the curve around a point is checked

Resolution = tuple[float, float]  # how far links travel (m) and turn (rad) between two checks


@dataclass(eq=False)
class Space:
    """Some coordinates of a cell, and what tells whether the way between two places is free.

    Attributes:
        cell: The cell.
        robots: The robots whose coordinates these are.
        free: Indices of the coordinates among the cell's, (d,).
        base: All coordinates of the cell; where those are that stay, (D,) (rad, m).
        bounds: Lower and upper bound of each, (d, 2) (rad, m).
        speeds: Largest speed of each, (d,) (rad/s, m/s).
        checker: Tells whether a place is free.
        progress: What counts the checks.
        purpose: What is being done, in words.
        when: The time at which moving obstacles are checked (s).
        proofs: What may cut goals off.
    """

    cell: Cell
    robots: tuple[str, ...]
    free: NDArray[np.intp]
    base: Floats
    bounds: Floats
    speeds: Floats
    checker: Checker
    progress: Progress
    purpose: str = "searching"
    when: float | None = None
    proofs: InfeasibilityProofs | None = None
    _known: dict[tuple[bytes, bytes, Resolution], bool] = field(
        default_factory=dict, init=False, repr=False
    )

    def whole(self, places: Floats) -> Floats:
        """Return all coordinates of the cell at some places, (…, D).

        Args:
            places: (…, d) (rad, m).
        """
        whole = np.empty((*places.shape[:-1], self.cell.size))
        whole[...] = self.base
        whole[..., self.free] = places
        return whole

    def are_free(self, places: Floats) -> NDArray[np.bool_]:
        """Tell which places are free, (n,).

        Args:
            places: (n, d) (rad, m).
        """
        self.progress.tell(self.purpose)
        return self.checker.free(self.whole(places), self.when)

    def edge_free(self, a: Floats, b: Floats, resolution: Resolution) -> bool:
        """Tell whether the straight way between two places is free; asked twice, from memory."""
        key = a.tobytes(), b.tobytes(), resolution
        if key not in self._known:
            self.progress.tell(self.purpose)
            times = None if self.when is None else (self.when, self.when)
            ends = self.whole(a), self.whole(b)
            self._known[key] = self.checker.edge_free(*ends, resolution, times)
        return self._known[key]

    def path_free(self, points: Floats, resolution: Resolution) -> bool:
        """Tell whether the straight lines through points are free."""
        return all(
            self.edge_free(a, b, resolution) for a, b in zip(points[:-1], points[1:], strict=True)
        )

    def expect_connected(self, goals: Sequence[Floats]) -> None:
        """Refuse goals all of which are cut off from the start, as far as that can be proven.

        Raises:
            NoPlanError: If they are.
        """
        if self.proofs is not None:
            self.proofs.expect_one_reachable(self.whole(np.array(goals)))

    def blend_free(self, path: Path, corner: int, resolution: Resolution) -> bool:
        """Tell whether the curve around one point of a path is free.

        It is checked in straight pieces between places on it.
        """
        middle, half = path.corners[corner], path.blends[corner]
        return self.path_free(
            path.at(np.linspace(middle - half, middle + half, PIECES + 1)), resolution
        )

    def part(self, robots: Iterable[str], checker: Checker) -> Space:
        """Return the space of some of the robots.

        Args:
            robots: Their names.
            checker: What tells whether a place is free.
        """
        robots = tuple(robots)
        chosen = self.columns(robots)
        return replace(
            self,
            robots=robots,
            free=self.free[chosen],
            bounds=self.bounds[chosen],
            speeds=self.speeds[chosen],
            checker=checker,
            purpose=f"planning {', '.join(robots)}",
        )

    def columns(self, robots: Iterable[str]) -> NDArray[np.intp]:
        """Return which of the coordinates belong to some robots."""
        slices = [self.cell.slices[name] for name in robots]
        chosen = [any(s.start <= i < s.stop for s in slices) for i in self.free.tolist()]
        return np.flatnonzero(chosen)
