"""The certificate of a motion: a dense, exact check of all of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from layouts.validation.findings import length_text
from robot_layouts.core.bounds import FAR, checked_number
from robot_layouts.core.errors import MotionError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell, cell_of
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.collision.continuous import Curve, CurveCheck
from robot_layouts.motion.model.hermite import hermite_extremes
from robot_layouts.motion.timed_motion import TimedMotion
from robot_layouts.motion.timing import velocities

SMALLEST = 1e-6  # m, rad; of steps between moments
TOLERANCE = 0.01  # share of a limit of velocity or acceleration that is rounding
BEYOND = 1e-4  # rad, m: so far beyond a joint limit is rounding
MEASURED = 100  # moments at most at which the depth of overlaps is measured, which takes long
REACHES = 3  # moments around which the least clearance is looked for once more


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
