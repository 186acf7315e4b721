"""The certificate of a motion: a dense, exact check of all of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinematics.rotations import Floats
from layouts import Layout
from layouts.validation.arguments import Rectangle
from layouts.validation.findings import length_text
from motion import timing
from motion.cell import Cell, cell_of
from motion.collisions import Checker
from motion.curves import hermite, hermite_slopes

CHUNK = 2000  # moments that are looked at together
TOLERANCE = 0.01  # share of a limit of velocity or acceleration that is rounding
BEYOND = 1e-4  # rad, m: so far beyond a joint limit is rounding
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
        moments: How many postures were checked.
        step: The farthest that any point of any robot moves between two of them (m).
        turn: The farthest that any link turns between two of them (rad).
        collisions: The deepest overlap of each two bodies that collide.
        clearance: What came nearest, links of one robot left out; None if nothing was near.
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
        return not (self.collisions or self.joint_limits or self.too_fast)

    def __str__(self) -> str:
        """Show what was checked and what was found."""
        lines = [
            f"{'certified' if self.ok else 'NOT CERTIFIED'}: {self.duration:.2f} s,"
            f" {self.moments} moments at most {self.step * 1e3:.2g} mm and"
            f" {np.degrees(self.turn):.2g}° apart"
        ]
        lines += [f"  collision: {collision}" for collision in self.collisions]
        lines += [f"  joint limit: {text}" for text in self.joint_limits]
        lines += [f"  too fast: {text}" for text in self.too_fast]
        if self.clearance is not None and not self.collisions:
            lines.append(f"  least clearance: {self.clearance}")
        used = f"{self.velocity:.0%} of the largest velocities"
        if self.acceleration is not None:
            used += f", {self.acceleration:.0%} of the largest accelerations"
        return "\n".join([*lines, f"  {used}"])


def certify(
    layout: Layout,
    times: Floats,
    positions: Mapping[str, Floats],
    velocities: Mapping[str, Floats],
    *,
    obstacles: Sequence[Any],
    held: Sequence[Any],
    table: Rectangle | None,
    largest_velocities: Mapping[str, Floats],
    largest_accelerations: Mapping[str, Floats],
    step: float,
    turn: float,
) -> Certificate:
    """Check a motion; see `motion.Motion.certify`."""
    cell = cell_of(layout, obstacles, held, table)
    curve = _Curve(
        times,
        np.concatenate([positions[name] for name in cell.robots], axis=1),
        np.concatenate([velocities[name] for name in cell.robots], axis=1),
    )
    moments = _moments(cell, curve, step, turn)
    states = curve.at(moments)
    speed, too_fast = _speeds(cell, curve, _fastest(layout, largest_velocities))
    acceleration, too_hasty = _accelerations(cell, curve, largest_accelerations)
    collisions = _collisions(cell.checker(), moments, states)
    return Certificate(
        duration=float(times[-1]),
        moments=len(moments),
        step=step,
        turn=turn,
        collisions=collisions,
        clearance=_clearance(cell, curve),
        joint_limits=tuple(_beyond_limits(cell, moments, states)),
        too_fast=(*too_fast, *too_hasty),
        velocity=speed,
        acceleration=acceleration,
    )


@dataclass(frozen=True, eq=False)
class _Curve:
    """All coordinates over time."""

    times: Floats
    positions: Floats
    velocities: Floats

    def at(self, moments: Floats) -> Floats:
        return hermite(self.times, self.positions, self.velocities, moments)

    def speeds(self, moments: Floats) -> Floats:
        return hermite_slopes(self.times, self.positions, self.velocities, moments)


# -- moments -----------------------------------------------------------------------------------


def _moments(cell: Cell, curve: _Curve, step: float, turn: float) -> Floats:
    """Return moments so dense that nothing moves or turns farther between two of them.

    Pieces in which something does are halved, or cut more finely, until nothing does.
    """
    moments, radii = curve.times, _radii(cell)
    while True:
        travel, turned = _travel(cell, curve.at(moments), radii)
        pieces = np.maximum(np.ceil(travel / step), np.ceil(turned / turn))
        if (pieces <= 1).all():
            return moments
        cuts = np.where(pieces > 1, np.ceil(1.1 * pieces), 1).astype(int)
        parts = [
            np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(moments[:-1], moments[1:], cuts.tolist(), strict=True)
        ]
        moments = np.concatenate([*parts, moments[-1:]])


def _travel(cell: Cell, states: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Return how far any point of any link moves and any link turns from state to state, (n - 1,).

    A point moves at most as far as the link's origin, and with the turn around that.
    """
    moved, turned = [], []
    for first in range(0, len(states) - 1, CHUNK):
        poses = cell.poses(states[first : first + CHUNK + 1])
        shift = np.linalg.norm(np.diff(poses[:, :, :3, 3], axis=0), axis=-1)
        change = np.linalg.norm(np.diff(poses[:, :, :3, :3], axis=0), axis=(-2, -1))
        angle = 2 * np.arcsin(np.minimum(change / np.sqrt(8), 1.0))
        moved.append((shift + radii * angle).max(axis=1))
        turned.append(angle.max(axis=1))
    return np.concatenate(moved), np.concatenate(turned)


def _radii(cell: Cell) -> Floats:
    """Return how far each link's farthest corner is from its origin, (links,) (m)."""
    radii: list[float] = []
    for model in cell.models.values():
        farthest = [0.0] * len(model.kinematics.links)
        for hull in model.hulls:
            reach = float(np.linalg.norm(hull.corners, axis=1).max())
            farthest[hull.link] = max(farthest[hull.link], reach)
        radii += farthest
    return np.array(radii)


# -- collisions --------------------------------------------------------------------------------


def _collisions(checker: Checker, moments: Floats, states: Floats) -> tuple[Nearest, ...]:
    worst: dict[tuple[str, str], Nearest] = {}
    for first in range(0, len(moments), CHUNK):
        chunk, whens = states[first : first + CHUNK], moments[first : first + CHUNK]
        for i in np.flatnonzero(~checker.free(chunk, whens)).tolist():
            contact = checker.contact(chunk[i], float(whens[i]))
            if contact is None:
                continue
            near = Nearest(contact.names, contact.distance, float(whens[i]), contact.points)
            known = worst.get(near.names)
            if known is None or near.distance < known.distance:
                worst[near.names] = near
    return tuple(sorted(worst.values(), key=lambda near: near.distance))


def _clearance(cell: Cell, curve: _Curve) -> Nearest | None:
    """Return the nearest approach of different bodies: at the knots, then around the least."""
    solids, whole = cell.solids, cell.checker()
    apart = [solids[a].owner != solids[b].owner for a, b in whole.pairs.tolist()]
    kept = whole.pairs[np.array(apart, bool)]
    checker = Checker(cell, kept, np.zeros(len(kept)))
    if not len(checker.pairs):
        return None
    moments = curve.times
    distances = checker.distance(curve.at(moments), moments)
    for i in np.argsort(distances, kind="stable")[:REACHES].tolist():
        around = moments[max(i - 1, 0)], moments[min(i + 1, len(curve.times) - 1)]
        more = np.linspace(*around, 21)
        moments = np.concatenate([moments, more])
        distances = np.concatenate([distances, checker.distance(curve.at(more), more)])
    when = float(moments[np.argmin(distances)])
    contact = checker.nearest(curve.at(np.array([when]))[0], when)
    if contact is None:
        return None
    return Nearest(contact.names, contact.distance, when, contact.points)


# -- limits ------------------------------------------------------------------------------------


def _joints(cell: Cell) -> list[str]:
    return [f"{name}.{joint}" for name, p in cell.layout.items() for joint in p.robot.joints]


def _beyond_limits(cell: Cell, moments: Floats, states: Floats) -> list[str]:
    """Say which joints leave their limits, other than those that begin beyond them."""
    low = np.minimum(cell.limits[:, 0], states[0]) - BEYOND
    high = np.maximum(cell.limits[:, 1], states[0]) + BEYOND
    excess = np.maximum(low - states, states - high)
    names = _joints(cell)
    return [
        f"{names[j]} is {excess[i, j]:.3g} beyond its limit at {moments[i]:.2f} s"
        for j in np.flatnonzero(excess.max(axis=0) > 0).tolist()
        for i in [int(np.argmax(excess[:, j]))]
    ]


def _fastest(layout: Layout, given: Mapping[str, Floats]) -> Mapping[str, Floats]:
    if set(given) == set(layout):
        return given
    return {**timing.largest_velocities(layout, "pd_joint_pos"), **given}


def _speeds(cell: Cell, curve: _Curve, largest: Mapping[str, Floats]) -> tuple[float, list[str]]:
    middles = (curve.times[1:] + curve.times[:-1]) / 2
    moments = np.concatenate([curve.times, middles])
    limits = np.concatenate([largest[name] for name in cell.robots])
    return _shares(cell, "velocity", moments, np.abs(curve.speeds(moments)) / limits)


def _accelerations(
    cell: Cell, curve: _Curve, largest: Mapping[str, Floats]
) -> tuple[float | None, list[str]]:
    """Compare the mean acceleration between each two knots with the limits."""
    if not largest:
        return None, []
    unlimited = {name: np.full(p.robot.dof, np.inf) for name, p in cell.layout.items()}
    limits = np.concatenate(list({**unlimited, **largest}.values()))
    rates = np.diff(curve.velocities, axis=0) / np.diff(curve.times)[:, None]
    return _shares(cell, "acceleration", curve.times, np.abs(rates) / limits)


def _shares(cell: Cell, what: str, moments: Floats, shares: Floats) -> tuple[float, list[str]]:
    names = _joints(cell)
    found = [
        f"{names[j]} has {shares[i, j]:.0%} of its largest {what} at {moments[i]:.2f} s"
        for j in np.flatnonzero(shares.max(axis=0) > 1 + TOLERANCE).tolist()
        for i in [int(np.argmax(shares[:, j]))]
    ]
    return float(shares.max()), found
