"""The certificate of a motion: a dense, exact check of all of it.

Between two moments each coordinate goes no farther than the polygon of its piece's Bézier points
is long. That bounds how far every body travels, so that two bodies which are farther apart than
they can come nearer do not meet before the next moment; where they are not, moments are added.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from layouts.validation.findings import length_text
from robot_layouts.core.bounds import FAR, checked_number
from robot_layouts.core.errors import MotionError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell, cell_of
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.collision.travel import Intervals, TravelBounds
from robot_layouts.motion.model.bodies import Bodies
from robot_layouts.motion.timed_motion import TimedMotion, hermite, hermite_extremes, hermite_slopes
from robot_layouts.motion.timing import velocities

CHUNK = 1024  # pieces that are checked together
MOST_CUTS = 64  # of a piece at once
MOST_MOMENTS = 10_000_000  # besides those between near bodies; that many take minutes
FINEST = 1e-5  # m; bodies that come nearer by no more than that between two moments are ignored
ROUNDING = 1e-5  # m; of distances that FCL finds by iteration
SPARSE = 0.02  # m; how far bodies travel between moments at which clearances are measured
SMALLEST = 1e-6  # m, rad; of steps between moments
TOLERANCE = 0.01  # share of a limit of velocity or acceleration that is rounding
BEYOND = 1e-4  # rad, m: so far beyond a joint limit is rounding
MEASURED = 100  # moments at most at which the depth of overlaps is measured, which takes long
REACHES = 3  # moments around which the least clearance is looked for once more


@dataclass(frozen=True, eq=False)
class Curve:
    """All coordinates over time.

    Attributes:
        times: Of the knots, (T,) (s).
        positions: There, (T, D) (rad, m).
        velocities: There, (T, D) (rad/s, m/s).
    """

    times: Floats
    positions: Floats
    velocities: Floats

    def at(self, moments: Floats) -> Floats:
        """Return the coordinates at some times, (n, D) (rad, m)."""
        return hermite(self.times, self.positions, self.velocities, moments)

    def speeds(self, moments: Floats) -> Floats:
        """Return their velocities at some times, (n, D) (rad/s, m/s)."""
        return hermite_slopes(self.times, self.positions, self.velocities, moments)

    def ways(self, starts: Floats, ends: Floats) -> Intervals:
        """Return how far the coordinates go at most in pieces that have no knot inside.

        Args:
            starts: When the pieces begin, (n,) (s).
            ends: When they end, (n,) (s).
        """
        a, b = self.at(starts), self.at(ends)
        third = (ends - starts)[:, None] / 3
        points = np.stack([a, a + third * self.speeds(starts), b - third * self.speeds(ends), b])
        lengths = np.abs(np.diff(points, axis=0)).sum(axis=0)
        return Intervals(starts, ends, lengths, np.abs(points).max(axis=0))


class SeenAlong(NamedTuple):
    """What was seen along a curve.

    Attributes:
        moments: How many moments were checked.
        overlaps: Those at which bodies overlap, (k,) (s).
        sparse: Some of all, between which bodies travel about 2 cm, (m,) (s).
    """

    moments: int
    overlaps: Floats
    sparse: Floats


class CurveCheck:
    """A look for overlaps along all of a curve."""

    def __init__(
        self, cell: Bodies, checker: Checker, curve: Curve, step: float, turn: float
    ) -> None:
        """Prepare it.

        Args:
            cell: The cell.
            checker: What may not overlap.
            curve: Where all coordinates are.
            step: The farthest that any point may travel between two moments (m).
            turn: The farthest that any body may turn between two moments (rad).
        """
        self._checker, self._curve, self._step, self._turn = checker, curve, step, turn
        self._travel = TravelBounds(cell)
        self._parts = np.array([solid.part for solid in cell.solids], np.intp)

    def run(self) -> SeenAlong:
        """Return what is seen.

        Raises:
            MotionError: If it takes too many moments.
        """
        times = self._curve.times
        waiting = [(times, np.append(times[1:], times[-1]))]  # the last one is a moment
        self._expect_few(*waiting[0])
        moments, travelled = 0, 0.0
        overlaps, sparse = [np.zeros(0)], [times[:1]]
        while waiting:
            starts, ends = waiting.pop()
            if len(starts) > CHUNK:
                waiting.append((starts[CHUNK:], ends[CHUNK:]))
            ways = self._curve.ways(starts[:CHUNK], ends[:CHUNK])
            moved, pieces = self._bounds(ways)
            if (pieces > 1).any():
                cuts = np.clip(np.ceil(1.1 * pieces), 2, MOST_CUTS)
                waiting.append(_cut(ways, np.where(pieces > 1, cuts, 1)))
                continue
            overlapping, open_ = self._look_at(ways, moved)
            moments += len(ways.starts) - len(open_)  # each of these is checked once more
            if len(open_):
                waiting.append(_cut(ways.only(open_), np.full(len(open_), 2)))
            overlaps.append(ways.starts[overlapping])
            marks = np.cumsum([travelled, *moved.max(axis=1)])
            sparse.append(ways.starts[np.diff(marks // SPARSE) > 0])
            travelled = marks[-1]
        return SeenAlong(
            moments, np.unique(np.concatenate(overlaps)), np.unique(np.concatenate(sparse))
        )

    def _expect_few(self, starts: Floats, ends: Floats) -> None:
        """Refuse a curve that takes too many moments.

        Raises:
            MotionError: If it does.
        """
        moments = 0.0
        for first in range(0, len(starts), CHUNK):
            some = slice(first, first + CHUNK)
            moments += np.ceil(self._bounds(self._curve.ways(starts[some], ends[some]))[1]).sum()
        if moments > MOST_MOMENTS:
            raise MotionError(
                f"to certify this motion takes about {moments:.2g} moments, more than"
                f" {MOST_MOMENTS:.2g}; ask for a larger step and turn, or certify it in parts"
            )

    def _bounds(self, ways: Intervals) -> tuple[Floats, Floats]:
        """Return how far parts travel, (n, parts) (m), and into how many pieces to cut, (n,)."""
        moved, turned = self._travel.along(ways)
        return moved, np.maximum(moved.max(axis=1) / self._step, turned.max(axis=1) / self._turn)

    def _look_at(self, ways: Intervals, moved: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the pieces that begin with an overlap, and those others that may have one."""
        overlapping, undecided = [], []
        states = self._curve.at(ways.starts)
        for found, gaps in self._checker.within(states, ways.starts, moved):
            parts = self._parts[found.pairs]
            both = np.take_along_axis(moved[found.states], parts, axis=1)
            nearing = self._travel.nearing(ways.only(found.states), both, parts)
            overlapping.append(found.states[gaps < 0])
            undecided.append(found.states[(nearing > FINEST) & (gaps < nearing + ROUNDING)])
        hits = np.unique(np.concatenate(overlapping))
        return hits, np.setdiff1d(np.concatenate(undecided), hits)


def _cut(ways: Intervals, pieces: Floats) -> tuple[Floats, Floats]:
    """Return starts and ends of ways, each cut into some pieces, (n,)."""
    counts = pieces.astype(np.intp)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(counts.sum()) - firsts) / np.repeat(counts, counts)
    begin, length = np.repeat(ways.starts, counts), np.repeat(ways.ends - ways.starts, counts)
    starts = begin + share * length
    last = np.cumsum(counts) - 1
    ends = np.append(starts[1:], starts[-1:])
    ends[last] = ways.ends
    return starts, ends


@dataclass(frozen=True)
class Nearest:
    """What came nearest to each other.

    Attributes:
        names: A robot's link as ``left/panda_hand``, a table or an obstacle; two of them.
        distance: Between them (m); negative if they overlap, by how much.
        time: When (s).
        points: The nearest points of both in the world (m).
    """

    names: tuple[str, str]
    distance: float
    time: float
    points: tuple[tuple[float, ...], tuple[float, ...]]

    def __str__(self) -> str:
        """Say who, when, and how near."""
        one, other = self.names
        if self.distance < 0:
            return (
                f"at {self.time:.2f} s {one} and {other} overlap by {length_text(-self.distance)}"
            )
        return f"at {self.time:.2f} s {one} comes within {length_text(self.distance)} of {other}"


@dataclass(frozen=True)
class Certificate:
    """What a dense check of a motion found.

    Attributes:
        duration: Of the motion (s).
        moments: How many postures were checked; 0 if joints leave their limits or are too fast.
        step: The farthest that any point of any robot moves between two of them (m).
        turn: The farthest that any link turns between two of them (rad).
        collisions: The deepest overlap of each two bodies that collide.
        clearance: What came nearest, links of one robot left out; None if nothing was near, or if
            bodies collide.
        joint_limits: Joints beyond their limits, in words.
        too_fast: Joints that exceed their largest velocity or acceleration, in words.
        velocity: The largest share of a joint's largest velocity that is used.
        acceleration: The largest share of a joint's largest acceleration; None without limits.
    """

    duration: float
    moments: int
    step: float
    turn: float
    collisions: tuple[Nearest, ...]
    clearance: Nearest | None
    joint_limits: tuple[str, ...]
    too_fast: tuple[str, ...]
    velocity: float
    acceleration: float | None

    @property
    def ok(self) -> bool:
        """Whether nothing collides and all limits are kept."""
        near = self.clearance
        apart = near is None or near.distance >= 0
        return apart and not (self.collisions or self.joint_limits or self.too_fast)

    def __str__(self) -> str:
        """Show what was checked and what was found."""
        looked = (
            f"{self.moments} moments at most {self.step * 1e3:.2g} mm and"
            f" {np.degrees(self.turn):.2g}° apart"
            if self.moments
            else "collisions were not looked for, as joints do what they cannot"
        )
        lines = [f"{'certified' if self.ok else 'NOT CERTIFIED'}: {self.duration:.2f} s, {looked}"]
        lines += [f"  collision: {collision}" for collision in self.collisions]
        lines += [f"  joint limit: {text}" for text in self.joint_limits]
        lines += [f"  too fast: {text}" for text in self.too_fast]
        if self.clearance is not None:
            lines.append(f"  least clearance: {self.clearance}")
        used = f"{self.velocity:.0%} of the largest velocities"
        if self.acceleration is not None:
            used += f", {self.acceleration:.0%} of the largest accelerations"
        return "\n".join([*lines, f"  {used}"])


def certify(motion: TimedMotion, step: float, turn: float) -> Certificate:
    """Check a motion; see `robot_layouts.motion.Motion.certify`."""
    step = checked_number("step", step, SMALLEST, FAR, MotionError, "m")
    turn = checked_number("turn", turn, SMALLEST, FAR, MotionError, "rad")
    cell = cell_of(motion.layout, motion.obstacles, motion.held, motion.table)
    curve = Curve(
        motion.times,
        np.concatenate([motion.positions[name] for name in cell.robots], axis=1),
        np.concatenate([motion.velocities[name] for name in cell.robots], axis=1),
    )
    moments, places, speeds = hermite_extremes(curve.times, curve.positions, curve.velocities)
    joint_limits = _beyond_limits(cell, curve.positions[0], moments, places)
    fastest = largest_velocities(motion)
    limits = np.concatenate([fastest[name] for name in cell.robots])
    speed, too_fast = _shares(cell, "velocity", moments, np.abs(speeds) / limits)
    acceleration, too_hasty = _accelerations(cell, curve, motion.largest_accelerations)
    found = Certificate(
        duration=motion.duration,
        moments=0,
        step=step,
        turn=turn,
        collisions=(),
        clearance=None,
        joint_limits=tuple(joint_limits),
        too_fast=(*too_fast, *too_hasty),
        velocity=speed,
        acceleration=acceleration,
    )
    if joint_limits or too_fast:
        return found
    checker = cell.checker()
    seen = CurveCheck(cell, checker, curve, step, turn).run()
    collisions = _collisions(checker, seen.overlaps, curve)
    return replace(
        found,
        moments=seen.moments,
        collisions=collisions,
        clearance=None if collisions else _clearance(cell, curve, seen.sparse),
    )


# -- collisions --------------------------------------------------------------------------------


def _collisions(checker: Checker, moments: Floats, curve: Curve) -> tuple[Nearest, ...]:
    """Return the deepest overlap of each two bodies, the deepest first, of some of the moments."""
    worst: dict[tuple[str, str], Nearest] = {}
    for when in moments[:: len(moments) // MEASURED + 1].tolist():
        contact = checker.contact(curve.at(np.array([when]))[0], when)
        if contact is None:
            continue
        near = Nearest(contact.names, contact.distance, when, contact.points)
        known = worst.get(near.names)
        if known is None or near.distance < known.distance:
            worst[near.names] = near
    return tuple(sorted(worst.values(), key=lambda near: near.distance))


def _clearance(cell: Cell, curve: Curve, moments: Floats) -> Nearest | None:
    """Return the nearest approach of different bodies: at some moments, then around the least."""
    checker = cell.between_owners()
    if not len(checker.pairs):
        return None
    looked, distances = moments, checker.distance(curve.at(moments), moments)
    for i in np.argsort(distances, kind="stable")[:REACHES].tolist():
        around = moments[max(i - 1, 0)], moments[min(i + 1, len(moments) - 1)]
        more = np.linspace(*around, 21)
        looked = np.concatenate([looked, more])
        distances = np.concatenate([distances, checker.distance(curve.at(more), more)])
    when = float(looked[np.argmin(distances)])
    contact = checker.nearest(curve.at(np.array([when]))[0], when)
    if contact is None:
        return None
    return Nearest(contact.names, contact.distance, when, contact.points)


# -- limits ------------------------------------------------------------------------------------


def _joints(cell: Cell) -> list[str]:
    return [f"{name}.{joint}" for name, p in cell.layout.items() for joint in p.robot.joints]


def _beyond_limits(cell: Cell, start: Floats, moments: Floats, places: Floats) -> list[str]:
    """Say which joints leave their limits, other than those that begin beyond them."""
    low = np.minimum(cell.limits[:, 0], start) - BEYOND
    high = np.maximum(cell.limits[:, 1], start) + BEYOND
    excess = np.maximum(low - places, places - high)
    names = _joints(cell)
    return [
        f"{names[j]} is {excess[i, j]:.3g} beyond its limit at {moments[i, j]:.2f} s"
        for j in np.flatnonzero(excess.max(axis=0) > 0).tolist()
        for i in [int(np.argmax(excess[:, j]))]
    ]


def largest_velocities(motion: TimedMotion) -> Mapping[str, Floats]:
    """Return how fast the joints of each robot may move, (dof,) (rad/s, m/s)."""
    given = motion.largest_velocities
    if set(given) == set(motion.layout):
        return given
    return {**velocities.largest_velocities(motion.layout, "pd_joint_pos"), **given}


def _accelerations(
    cell: Cell, curve: Curve, largest: Mapping[str, Floats]
) -> tuple[float | None, list[str]]:
    """Compare mean accelerations with the limits: those between two knots, or at their ends.

    Within a piece accelerations change evenly, so that they are largest where it begins or ends.
    """
    if not largest:
        return None, []
    unlimited = {name: np.full(p.robot.dof, np.inf) for name, p in cell.layout.items()}
    limits = np.concatenate(list({**unlimited, **largest}.values()))
    begin, end = curve.times[:-1], curve.times[1:]
    starts = np.concatenate([begin, np.maximum(begin, end - velocities.STEP)])
    ends = np.concatenate([np.minimum(end, begin + velocities.STEP), end])
    rates = (curve.speeds(ends) - curve.speeds(starts)) / (ends - starts)[:, None]
    moments = np.broadcast_to(starts[:, None], rates.shape)
    return _shares(cell, "acceleration", moments, np.abs(rates) / limits)


def _shares(cell: Cell, what: str, moments: Floats, shares: Floats) -> tuple[float, list[str]]:
    names = _joints(cell)
    found = [
        f"{names[j]} has {shares[i, j]:.0%} of its largest {what} at {moments[i, j]:.2f} s"
        for j in np.flatnonzero(shares.max(axis=0) > 1 + TOLERANCE).tolist()
        for i in [int(np.argmax(shares[:, j]))]
    ]
    return float(shares.max()), found
