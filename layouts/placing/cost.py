"""What base poses cost: who reaches what from there, with what clearance and shared workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from layouts.arrangement import Arrangement
from layouts.placing import ReachedBy
from layouts.placing.bases import BasePose
from layouts.placing.scene import SearchScene
from layouts.validation.reach import RADIAN, Arm
from robot_layouts.core.bounds import shown
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.solve import ITERATIONS
from robots import LayoutError, UnknownNameError

MISSING_COST = 100.0  # per m that is missing to a target
FARTHEST = 0.3  # m; being farther from a target costs no more
BLOCKED = 0.05  # m; a target that only a collision keeps from being reached counts as this far
CLEARANCE_COST = 20.0  # where a clearance that is asked for is missing altogether
MISALIGNMENT_COST = 0.3  # where all robots look away from their targets
GAP_VALUE = 1.0  # of full clearance, beside all workspace that can be shared
REACH_VALUE = 0.5  # of all robots that may reach a target being near enough
HOPELESS = 0.15  # m; what is so far from every sampled posture is not tried
FEW_STARTS, FEW_ITERATIONS = 8, 15  # of inverse kinematics, where a robot is only moved a little
ANY, ALL = "any", "all"

Bases = Mapping[str, BasePose]


@dataclass(frozen=True)
class Requirement:
    """One thing that is asked for: that one of some arms reaches a target.

    Attributes:
        target: Name of the target.
        numbers: Its place in the world (m), perhaps with the wxyz orientation of the TCP.
        arms: Full names of the arms of which one must reach it.
    """

    target: str
    numbers: tuple[float, ...]
    arms: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Assignment:
    """Which arm meets a requirement and how, or comes nearest to that.

    Attributes:
        arm: Full name of the arm.
        qpos: Joint positions of its robot, (dof,) (rad, m).
        missing: How far the target is (m), turns included; 0 if it is reached.
        gaps: Distance to each other robot at its keyframe (m); empty if it is not reached.
    """

    arm: str
    qpos: Floats
    missing: float
    gaps: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Candidate:
    """Base poses, and how good they are.

    Attributes:
        bases: By robot.
        assignments: One for each requirement.
        cost: The less, the better; negative if nothing that is asked for is missing.
    """

    bases: Bases
    assignments: tuple[Assignment, ...]
    cost: float


def requirements_of(
    targets: Mapping[str, tuple[float, ...]], reached_by: ReachedBy, robots: Arrangement
) -> tuple[Requirement, ...]:
    """Return what is asked for; see `layouts.search`.

    Raises:
        LayoutError: If ``reached_by`` is invalid.
        UnknownNameError: If it names no target, robot or limb.
    """
    if not isinstance(reached_by, Mapping):
        reached_by = dict.fromkeys(targets, reached_by)
    for name in reached_by:
        if name not in targets:
            raise UnknownNameError("target", name, targets)
    return tuple(
        Requirement(name, numbers, arms)
        for name, numbers in targets.items()
        for arms in _choices(reached_by.get(name, ANY), robots)
    )


def _choices(who: object, robots: Arrangement) -> list[tuple[str, ...]]:
    """Return for each arm that must reach a target the arms that can be it."""
    if who == ANY:
        return [tuple(robots.arms)]
    if who == ALL:
        return [(arm,) for arm in robots.arms]
    names = [who] if isinstance(who, str) else who
    if not (isinstance(names, Sequence) and names and all(isinstance(n, str) for n in names)):
        raise LayoutError(
            f"reached_by is {shown(who)}; it takes 'any', 'all', the name of a robot or limb, or"
            " several names"
        )
    known = list(dict.fromkeys([*robots, *robots.arms, *robots.short_names, ANY, ALL]))
    choices: list[tuple[str, ...]] = []
    for name in names:
        if name not in known:
            raise UnknownNameError("robot that is to reach a target", name, known)
        full = robots.arm_name(name)
        own = tuple(arm for arm in robots.arms if robots.owner(arm) == full)
        choices.append((full,) if full in robots.arms else own)
    return choices


class Cost:
    """The cost of base poses, for the requirements of one search."""

    def __init__(
        self, scene: SearchScene, requirements: Sequence[Requirement], clearance: float
    ) -> None:
        """Take what is asked for.

        Args:
            scene: The robots.
            requirements: Who must reach what.
            clearance: Least distance between robots (m).
        """
        self._scene, self.requirements, self.clearance = scene, tuple(requirements), clearance
        self.count = 0  # of candidates
        self.choices = sum(len(requirement.arms) for requirement in self.requirements)
        self._targets = {name: self._targets_of(name) for name in scene.robots}
        self._largest_shared = scene.largest_shared_volume()
        self._targets_within_reach = cache(self._count_within_reach)

    def candidate(self, bases: Bases) -> Candidate:
        """Return base poses with their cost, whatever was known of others."""
        assignments = [self._assign(r, bases, r.arms) for r in self.requirements]
        return Candidate(bases, tuple(assignments), self._total(bases, assignments))

    def moved(self, before: Candidate, name: str, base: BasePose) -> Candidate | None:
        """Return a candidate with one robot elsewhere; None if that costs no less.

        Args:
            before: What it is compared with.
            name: The robot.
            base: Where to.
        """
        self.count += 1
        bases = {**before.bases, name: base}
        allowed = (before.cost - self._total(bases, ())) / MISSING_COST  # m, missing to targets
        assignments = self._followed(before, name, bases, allowed) if allowed > 0 else None
        if assignments is None:
            return None
        cost = self._total(bases, assignments)
        return Candidate(bases, tuple(assignments), cost) if cost < before.cost else None

    def lacking(self, gap: float | Floats) -> Floats:
        """Return how much of the clearance asked for is missing, in shares of a dm or of it."""
        return np.maximum(self.clearance - gap, 0.0) / max(self.clearance, 0.1)

    def misalignment(self, name: str, bases: Floats, others: Sequence[Floats]) -> Floats:
        """Return how badly a robot stands for what it may have to reach; see `SearchScene`."""
        return self._scene.misalignment(name, bases, self._targets[name], others)

    def _targets_of(self, name: str) -> Floats:
        """Return the targets that a robot may have to reach, or else all of them, (n, 3) (m)."""
        arms = self._scene.arms
        own = [r for r in self.requirements if any(arms[arm].owner == name for arm in r.arms)]
        targets = [requirement.numbers[:3] for requirement in own or self.requirements]
        return np.array(targets, float).reshape(-1, 3)

    # -- the parts of the cost ---------------------------------------------------------------

    def _total(self, bases: Bases, assignments: Sequence[Assignment]) -> float:
        """Return the cost; without assignments, its lower bound."""
        scene = self._scene
        placed = {name: scene.placed(name, base) for name, base in bases.items()}
        sunk = sum(not robot.on_table for robot in placed.values())
        missing = sum(assignment.missing for assignment in assignments)
        gaps = [[(a, b, scene.gap(a, bases[a], b, bases[b])) for a, b in scene.pairs]]
        for assigned in assignments:
            owner = scene.arms[assigned.arm].owner
            gaps.append([(owner, other, gap) for other, gap in assigned.gaps.items()])
        lacking = sum(sum(float(self.lacking(gap)) for _, _, gap in some) for some in gaps)
        ratios = (gap / scene.ample_gap(a, b) for some in gaps for a, b, gap in some)
        least = min([1.0, *ratios])
        shared = sum(scene.shared_volume(a, bases[a], b, bases[b]) for a, b in scene.pairs)
        reach = sum(
            self._targets_within_reach(arm.name, bases[arm.owner]) for arm in scene.arms.values()
        )
        away = [
            self.misalignment(n, r.base[None], [o.base for m, o in placed.items() if m != n])[0]
            for n, r in placed.items()
        ]
        cost = MISSING_COST * missing + CLEARANCE_COST * (sunk + lacking)
        value = shared / self._largest_shared if self._largest_shared else 0.0
        value = value + GAP_VALUE * max(least, 0.0) + REACH_VALUE * (reach / max(self.choices, 1))
        return cost + MISALIGNMENT_COST * float(np.mean(away)) - value

    def _count_within_reach(self, name: str, base: BasePose) -> int:
        """Return how many targets that an arm may reach are well within its reach, by samples."""
        arm = self._scene.arms[name]
        matrix = self._scene.placed(arm.owner, base).base[None]
        own = [r.numbers for r in self.requirements if name in r.arms]
        return sum(float(arm.beyond(matrix, numbers)[0]) == 0 for numbers in own)

    # -- assignments -------------------------------------------------------------------------

    def _followed(
        self, before: Candidate, name: str, bases: Bases, allowed: float
    ) -> list[Assignment] | None:
        """Return the assignments after one robot has moved.

        None as soon as more is missing to the targets than is allowed (m).
        """
        kept = self._kept(before, name, bases)
        assignments: list[Assignment] = []
        for number in range(len(self.requirements)):
            assignment = kept.get(number) or self._reassigned(number, before, name, bases)
            allowed -= assignment.missing
            if allowed <= 0:
                return None
            assignments.append(assignment)
        return assignments

    def _kept(self, before: Candidate, name: str, bases: Bases) -> dict[int, Assignment]:
        """Return the assignments that stay as they were, or that follow their robot."""
        scene = self._scene
        kept: dict[int, Assignment] = {}
        followers: dict[tuple[str, int], list[int]] = {}
        for number, own in enumerate(before.assignments):
            if own.missing > 0:
                continue
            owner = scene.arms[own.arm].owner
            if owner == name:
                kind = len(self.requirements[number].numbers)
                followers.setdefault((own.arm, kind), []).append(number)
                continue
            posture = scene.posture(owner, before.bases[owner], own.qpos)
            if not scene.near(posture, name, bases[name], self.clearance):
                gap = scene.gap_to_start(posture, name, bases[name])
                kept[number] = Assignment(own.arm, own.qpos, 0.0, {**own.gaps, name: gap})
        base = scene.placed(name, bases[name]).base
        for (arm, _), numbers in followers.items():
            starts = np.array([[before.assignments[number].qpos] for number in numbers])
            targets = [self.requirements[number].numbers for number in numbers]
            found = scene.arms[arm].solve(
                targets, base=base, starts=starts, iterations=FEW_ITERATIONS
            )
            for row, number in enumerate(numbers):
                if found.solved[row] and (own := self._checked(arm, bases, found.qpos[row])):
                    kept[number] = own
        return kept

    def _reassigned(self, number: int, before: Candidate, name: str, bases: Bases) -> Assignment:
        """Return the assignment of a requirement that is not met any more, or was not before."""
        requirement, own = self.requirements[number], before.assignments[number]
        if own.missing > BLOCKED:  # no other robot has come nearer
            moved = [arm for arm in requirement.arms if self._scene.arms[arm].owner == name]
            tried = self._assign(requirement, bases, moved, quick=True)
            return tried if tried.missing < own.missing or own.arm in moved else own
        return self._assign(requirement, bases, requirement.arms, quick=True)

    def _assign(
        self, requirement: Requirement, bases: Bases, arms: Sequence[str], *, quick: bool = False
    ) -> Assignment:
        """Return how an arm reaches a target, or how near one comes; the likeliest goes first."""
        scene = self._scene
        first = scene.arms[requirement.arms[0]]
        best = Assignment(first.name, scene.start(first.owner), np.inf, {})
        far: dict[str, float] = {}
        for name in arms:
            base = scene.placed(scene.arms[name].owner, bases[scene.arms[name].owner]).base
            far[name] = float(scene.arms[name].beyond(base[None], requirement.numbers)[0])
        for brief in (True,) if quick else (True, False):
            for name in sorted(arms, key=lambda arm: far[arm]):
                tried = self._by(scene.arms[name], requirement, bases, far[name], quick=brief)
                if tried.missing == 0:
                    return tried
                best = tried if tried.missing < best.missing else best
        return best

    def _by(
        self, arm: Arm, requirement: Requirement, bases: Bases, far: float, *, quick: bool
    ) -> Assignment:
        """Return how one arm reaches a target that is about so far beyond its reach (m)."""
        start = self._scene.start(arm.owner)
        if far > HOPELESS:
            return Assignment(arm.name, start, min(far, FARTHEST), {})
        found = arm.solve(
            [requirement.numbers],
            base=self._scene.placed(arm.owner, bases[arm.owner]).base,
            starts=(arm.starts[:FEW_STARTS] if quick else arm.starts)[None],
            iterations=FEW_ITERATIONS if quick else ITERATIONS,
        )
        ranked = found.ranked(start)
        if not found.solved[ranked[0]]:
            missing = found.missing + RADIAN * found.turn_missing
            row = int(np.argmin(missing))
            return Assignment(arm.name, found.qpos[row], min(float(missing[row]), FARTHEST), {})
        for row in ranked:
            if assignment := self._checked(arm.name, bases, found.qpos[row]):
                return assignment
        return Assignment(arm.name, found.qpos[ranked[0]], BLOCKED, {})

    def _checked(self, arm: str, bases: Bases, qpos: Floats) -> Assignment | None:
        """Return an assignment by a posture; None if something is in its way, or nearly."""
        scene = self._scene
        owner = scene.arms[arm].owner
        posture = scene.posture(owner, bases[owner], qpos)
        others = {other: base for other, base in bases.items() if other != owner}
        if not scene.free(owner, posture) or any(
            scene.near(posture, other, base, self.clearance) for other, base in others.items()
        ):
            return None
        gaps = {other: scene.gap_to_start(posture, other, base) for other, base in others.items()}
        return Assignment(arm, qpos, 0.0, gaps)
