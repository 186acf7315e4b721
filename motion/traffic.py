"""What moves as it was told while a plan is carried out, and when one can set out in between."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinematics.rotations import Floats
from motion.cell import Cell
from motion.collisions import Checker
from motion.curves import hermite, hermite_slopes
from motion.obstacles import Track
from motion.spaces import Resolution
from motion.timing import STEP
from robots.common.progress import Progress

LATER = 10 * STEP  # s; how much later a motion is tried next
SPARE = 2.0  # s; how long after everything else stands still a motion may set out


@dataclass(frozen=True, eq=False)
class Course:
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

    def later(self, delay: float) -> Course:
        """Return the same, some time later (s)."""
        return replace(self, times=self.times + delay)


@dataclass(frozen=True, eq=False)
class Traffic:
    """All coordinates of a cell over time.

    Attributes:
        cell: The cell.
        base: Where the coordinates are that no course moves, (D,) (rad, m).
        courses: Those that are moved.
    """

    cell: Cell
    base: Floats
    courses: tuple[Course, ...] = ()

    @property
    def end(self) -> float:
        """When everything stands still (s): courses, and obstacles on their tracks."""
        tracks = [o.pose.times[-1] for o in self.cell.obstacles if isinstance(o.pose, Track)]
        return float(max([0.0, *tracks, *(course.end for course in self.courses)]))

    def with_course(self, course: Course) -> Traffic:
        """Return the same with another course."""
        return replace(self, courses=(*self.courses, course))

    def positions(self, times: ArrayLike) -> Floats:
        """Return all coordinates at some times, (…, D) (rad, m)."""
        states = np.tile(self.base, (*np.shape(times), 1))
        for c in self.courses:
            states[..., c.columns] = hermite(c.times, c.positions, c.velocities, times)
        return states

    def velocities(self, times: ArrayLike) -> Floats:
        """Return how fast all coordinates move at some times, (…, D) (rad/s, m/s)."""
        speeds = np.zeros((*np.shape(times), len(self.base)))
        for c in self.courses:
            speeds[..., c.columns] = hermite_slopes(c.times, c.positions, c.velocities, times)
        return speeds

    def knots(self) -> Floats:
        """Return times from 0 to the end or a little later, `STEP` apart, (T,) (s).

        What was planned has its knots there, too.
        """
        count = max(int(np.ceil(self.end / STEP - 1e-6)), 1)
        return np.arange(count + 1.0) * STEP


def first_free(
    traffic: Traffic, course: Course, checker: Checker, resolution: Resolution, progress: Progress
) -> Course | None:
    """Return a course that sets out as early as it collides with nothing, or None.

    Args:
        traffic: What moves as it was told.
        course: What may set out later.
        checker: Tells what must not come near to what.
        resolution: How far things may move between two moments that are looked at.
        progress: What counts the checks.

    Raises:
        NoPlanError: If the time given is over.
    """
    for i in range(int((traffic.end + SPARE) / LATER) + 1):
        progress.tell("waiting for others")
        tried = course.later(i * LATER)
        if _is_free(traffic.with_course(tried), checker, resolution):
            return tried
    return None


def _is_free(traffic: Traffic, checker: Checker, resolution: Resolution) -> bool:
    times = traffic.knots()
    states = traffic.positions(times)
    if not checker.free(states, times).all():
        return False
    return all(
        checker.edge_free(states[i], states[i + 1], resolution, (times[i], times[i + 1]))
        for i in range(len(times) - 1)
    )


def columns_of(cell: Cell, robots: Iterable[str]) -> NDArray[np.intp]:
    """Return the indices of all coordinates of some robots."""
    parts: Sequence[slice] = [cell.slices[name] for name in robots]
    return np.concatenate([np.arange(part.start, part.stop) for part in parts])
