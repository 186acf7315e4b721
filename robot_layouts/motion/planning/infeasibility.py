"""Proofs that no motion leads from a start to a goal: values that a joint cannot pass.

A joint that turns within limits passes all values between its start and its goal. Where two bodies
overlap at one of these values, wherever the joints before it are, there is no way. That is proven,
not sampled: two convex bodies that overlap by some depth still do when no point of either has moved
farther than that. So a box of positions of the joints before is out of the question if the overlap
in its middle is deeper than the bodies travel from there to the sides; other boxes are halved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.solve import scattered
from robot_layouts.kinematics.tree import Tree
from robot_layouts.motion.collision.broad_phase import BroadPhase
from robot_layouts.motion.collision.narrow_phase import NarrowPhase
from robot_layouts.motion.collision.travel import TravelBounds
from robot_layouts.motion.model.bodies import Bodies

MOST_BEFORE = 2  # joints whose positions are gone through
STEP = 0.35  # rad, m: between values that are checked
TRIED = 2  # values of a joint, those of the deepest overlap
SAMPLES = 8  # positions of the joints before, at each of which there must be an overlap
BOXES = 256  # that are checked for one value
CUT_OFF = "cut off"  # why there is no plan
SURE = 1e-3  # m; how much deeper than necessary an overlap has to be

_Pair = tuple[int, int]


@dataclass(frozen=True)
class InfeasibilityProof:
    """A value that a joint would have to pass and cannot.

    Attributes:
        robot: The robot.
        joint: The joint.
        value: The value (rad, or m if the joint slides).
        unit: That of the value.
        bodies: What overlaps there, one or another: links of the robot, each with what is in its
            way; names as in `robot_layouts.motion.collision.checker.Contact`.
    """

    robot: str
    joint: str
    value: float
    unit: str
    bodies: tuple[tuple[str, str], ...]

    def refusal(self) -> NoPlanError:
        """Return what to raise where this leaves no way."""
        return NoPlanError(f"{self.robot} cannot get to its goal: {self}", CUT_OFF)

    def __str__(self) -> str:
        """Say what would have to happen, and why it cannot."""
        own = f"{self.robot}/"
        overlaps = [" is in ".join(name.removeprefix(own) for name in b) for b in self.bodies]
        return (
            f"its {self.joint} would have to pass {self.value:.3g} {self.unit}, where"
            f" {' or '.join(overlaps)} whatever its other joints do"
        )


@dataclass(frozen=True, eq=False)
class _Gate:
    """A joint, and the pairs of bodies that may overlap whatever the joints behind it do.

    Attributes:
        joint: Its coordinate.
        before: The coordinates besides on which these pairs depend, (k,), k up to `MOST_BEFORE`.
        ranges: From where to where each of them can be, (k, 2) (rad, m).
        pairs: Of solids.
    """

    joint: int
    before: NDArray[np.intp]
    ranges: Floats
    pairs: list[_Pair]


_Check = tuple[_Gate, float]


class InfeasibilityProofs:
    """What cuts goals off from a start, for all robots that move."""

    def __init__(
        self, cell: Bodies, pairs: NDArray[np.intp], start: Floats, moving: NDArray[np.intp]
    ) -> None:
        """Sort pairs by the joints on which they depend.

        Args:
            cell: The cell.
            pairs: Pairs of its solids that may not overlap, and do not move by themselves, (m, 2).
            start: Where all coordinates are at the start, (D,) (rad, m).
            moving: Those that may move, (d,).
        """
        self._cell, self._start, self._moving = cell, start, set(moving.tolist())
        self._parts = np.array([solid.part for solid in cell.solids], np.intp)
        self._gates = list(self._gather(pairs))
        known = [pair for gate in self._gates for pair in gate.pairs]
        self._pairs = np.array(known, np.intp).reshape(-1, 2)

    def before(self, goal: Floats) -> InfeasibilityProof | None:
        """Return what cuts a goal off, or None if nothing is known that does.

        Args:
            goal: All coordinates there, (D,) (rad, m).
        """
        looks = [
            (gate, value)
            for gate in self._gates
            for value in _between(self._start[gate.joint], goal[gate.joint])
        ]
        for gate, value in self._deepest(self._closed(self._closed(looks, 1), SAMPLES)):
            overlapping = self._shut(gate, value)
            if overlapping:
                return self._barrier(gate, value, overlapping)
        return None

    def expect_one_reachable(self, goals: Floats) -> None:
        """Refuse goals all of which are cut off.

        Args:
            goals: All coordinates there, (n, D) (rad, m).

        Raises:
            NoPlanError: If they are.
        """
        proof = None
        for goal in goals:
            proof = self.before(goal)
            if proof is None:
                return
        if proof is not None:
            raise proof.refusal()

    # -- preparation -------------------------------------------------------------------------

    def _gather(self, pairs: NDArray[np.intp]) -> Iterator[_Gate]:
        """Yield the gates: for each joint what it moves against what does not depend on much."""
        found: dict[int, dict[_Pair, list[int]]] = {}
        for a, b in self._related(pairs).tolist():
            joints = self._joints(int(self._parts[a]), int(self._parts[b]))
            if 0 < len(joints) <= 1 + MOST_BEFORE:
                found.setdefault(joints[0], {})[a, b] = joints[1:]
        for joint, known in sorted(found.items()):
            before = max(known.values(), key=len)
            ranges = np.array([self._range(i) for i in before]).reshape(-1, 2)
            if np.isfinite(self._cell.limits[joint]).all() and np.isfinite(ranges).all():
                own = [pair for pair, joints in known.items() if set(joints) <= set(before)]
                yield _Gate(joint, np.array(before, np.intp), ranges, own)

    def _related(self, pairs: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return pairs of which only one moves, or both belong to one robot."""
        moved = np.array([bool(chain) for chain in self._chains_of])[self._parts[pairs]]
        robots = np.array([part.robot for part in self._cell.parts])[self._parts[pairs]]
        return pairs[(moved[:, 0] ^ moved[:, 1]) | (robots[:, 0] == robots[:, 1])]

    def _joints(self, a: int, b: int) -> list[int]:
        """Return the coordinates between two parts one of which carries the other, last first.

        A part that stays carries all; nothing is returned where neither carries the other.
        """
        short, long = sorted((self._chains_of[a], self._chains_of[b]), key=len)
        between = long[: len(long) - len(short)]
        if long != (*between, *short):
            return []
        return list(dict.fromkeys(self._drivers[part] for part in between))

    @cached_property
    def _chains_of(self) -> list[tuple[int, ...]]:
        """For each part it and those that carry it whose joints may move, the last first."""
        link_poses: list[tuple[int, ...]] = []
        for i, part in enumerate(self._cell.parts):  # what carries a part comes before it
            carriers = link_poses[part.parent] if part.parent >= 0 else ()
            link_poses.append((i, *carriers) if self._drivers[i] in self._moving else carriers)
        return link_poses

    @cached_property
    def _drivers(self) -> list[int]:
        """The coordinate that moves each part on the one that carries it; -1 for none."""
        parts, bodies = self._cell.parts, self._cell
        return [
            int(bodies.models[part.robot].kinematics.drivers[part.link])
            + bodies.slices[part.robot].start
            if part.robot
            else -1
            for part in parts
        ]

    def _range(self, joint: int) -> tuple[float, float]:
        """Return from where to where a coordinate can be (rad, m); one turn at most."""
        here, (low, high) = float(self._start[joint]), self._cell.limits[joint].tolist()
        low, high = min(low, here) - SURE, max(high, here) + SURE
        return (-np.pi, np.pi) if high - low > 2 * np.pi and self._turns(joint) else (low, high)

    def _turns(self, joint: int) -> bool:
        """Tell whether everything is the same after a whole turn of a coordinate."""
        _, tree, own = self._owner(joint)
        moved = tree.drivers == own
        return not tree.slides[moved].any() and bool((np.abs(tree.multipliers[moved]) == 1).all())

    def _owner(self, joint: int) -> tuple[str, Tree, int]:
        """Return the robot that a coordinate belongs to, its tree, and the number there."""
        for robot, own in self._cell.slices.items():
            if own.start <= joint < own.stop:
                return robot, self._cell.models[robot].kinematics, joint - own.start
        raise IndexError(joint)

    # -- single values -----------------------------------------------------------------------

    def _closed(self, looks: Sequence[_Check], samples: int) -> list[_Check]:
        """Return those values at which something overlaps in each of some postures."""
        if not looks:
            return []
        states = np.concatenate([self._samples(*look, samples) for look in looks])
        places = self._broad_phase.link_poses.places(states)
        asked = self._broad_phase.candidates(places)
        gates = np.repeat([gate.joint for gate, _ in looks], samples)
        asked = asked.only(self._joint_of[tuple(asked.pairs.T)] == gates[asked.states])
        near = self._narrow_phase.too_near(places, asked, every=False)
        shut = np.zeros(len(states), bool)
        shut[asked.states[near]] = True
        closed = np.flatnonzero(shut.reshape(len(looks), samples).all(axis=1))
        return [looks[i] for i in closed.tolist()]

    def _samples(self, gate: _Gate, value: float, count: int) -> Floats:
        """Return states at a value, the first with all other joints as at the start, (count, D)."""
        states = np.tile(self._start, (count, 1))
        if count > 1:
            states[1:, gate.before] = scattered(gate.ranges, count - 1)
        states[:, gate.joint] = value
        return states

    def _deepest(self, looks: Sequence[_Check]) -> Iterator[_Check]:
        """Yield for each joint the values of the deepest overlaps, as far as that is known."""
        for gate in self._gates:
            values = [value for other, value in looks if other is gate]
            states = [self._samples(gate, value, 1) for value in values]
            gaps = [min(self._gap(state[0], pair) for pair in gate.pairs) for state in states]
            for i in np.argsort(gaps, kind="stable")[:TRIED].tolist():
                yield gate, values[i]

    def _gap(self, state: Floats, pair: _Pair) -> float:
        """Return how far two solids are apart (m); negative if they overlap."""
        return self._narrow_phase.between(
            self._broad_phase.link_poses.places(state[None])[:, 0], *pair
        )[0]

    def _shut(self, gate: _Gate, value: float) -> list[_Pair]:
        """Return solids one pair of which overlaps at a value, wherever the joints before are.

        None are returned if that is not proven.
        """
        boxes, shut = [gate.ranges], dict[_Pair, None]()
        for _ in range(BOXES):
            if not boxes:
                return list(shut)
            box = boxes.pop()
            state, ways = self._middle(gate, value, box)
            nearest = np.inf
            for pair in sorted(gate.pairs, key=lambda pair: pair not in shut):
                gap = self._gap(state, pair)
                nearest = min(nearest, gap)
                if gap + ways[self._parts[pair[0]], self._parts[pair[1]]] < -SURE:
                    shut[pair] = None
                    break
            else:
                if nearest > 0.0 or not len(box):
                    return []
                boxes += _halves(box)
        return []

    def _middle(self, gate: _Gate, value: float, box: Floats) -> tuple[Floats, Floats]:
        """Return the state in the middle of a box, and how far parts move from there to its sides.

        The latter against each other, (parts, parts) (m).
        """
        middle, low, high = (self._samples(gate, value, 1)[0] for _ in range(3))
        middle[gate.before], (low[gate.before], high[gate.before]) = box.mean(axis=1), box.T
        return middle, self._travel.between(low, high) / 2

    def _barrier(self, gate: _Gate, value: float, pairs: Sequence[_Pair]) -> InfeasibilityProof:
        robot, tree, own = self._owner(gate.joint)
        unit = "m" if tree.slides[tree.drivers == own].any() else "rad"
        names = dict.fromkeys(self._names(pair, robot) for pair in pairs)
        return InfeasibilityProof(robot, tree.coordinates[own], float(value), unit, tuple(names))

    def _names(self, pair: _Pair, robot: str) -> tuple[str, str]:
        """Return the names of two solids, first that of the robot's own, or the one carried."""
        moved = [self._cell.solids[i].mover == robot for i in pair]
        depths = [len(self._chains_of[self._parts[i]]) for i in pair]
        first = int(np.lexsort((depths, moved))[-1])
        return self._cell.solids[pair[first]].name, self._cell.solids[pair[1 - first]].name

    @cached_property
    def _joint_of(self) -> NDArray[np.intp]:
        """The coordinate of the gate of each pair of solids, (solids, solids); -1 for none."""
        joints = np.full((len(self._parts), len(self._parts)), -1)
        for gate in self._gates:
            a, b = np.array(gate.pairs).T
            joints[a, b] = joints[b, a] = gate.joint
        return joints

    @cached_property
    def _broad_phase(self) -> BroadPhase:
        return BroadPhase(self._cell, self._pairs, np.zeros(len(self._pairs)))

    @cached_property
    def _narrow_phase(self) -> NarrowPhase:
        return NarrowPhase(
            self._cell, self._pairs, np.zeros(len(self._pairs)), self._broad_phase.link_poses
        )

    @cached_property
    def _travel(self) -> TravelBounds:
        return TravelBounds(self._cell)


def _between(start: float, end: float) -> Floats:
    """Return values between two others, evenly spaced."""
    return np.linspace(start, end, int(abs(end - start) / STEP) + 3)[1:-1]


def _halves(box: Floats) -> list[Floats]:
    """Return both halves of a box, which is cut where it is longest."""
    side = int(np.diff(box, axis=1).argmax())
    halves = [box.copy(), box.copy()]
    halves[0][side, 1] = halves[1][side, 0] = box[side].mean()
    return halves
