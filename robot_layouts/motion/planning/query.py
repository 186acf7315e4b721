"""One planning query: from a start to goals, past obstacles as they are at one moment."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import NoPlanError
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell, Clearances
from robot_layouts.motion.planning.goals import CANDIDATES, PlaceGoal, different
from robot_layouts.motion.planning.infeasibility import InfeasibilityProofs
from robot_layouts.motion.planning.prioritized import Coordination
from robot_layouts.motion.planning.rrt_connect import connect
from robot_layouts.motion.planning.shortcuts import rounded, shortened
from robot_layouts.motion.planning.space import Resolution, Space
from robot_layouts.motion.timing.paths import Path
from robot_layouts.motion.timing.trajectories import CellTrajectory

COMBINATIONS = 512  # of postures of all places that are tried at first
MORE = 4 * CANDIDATES  # postures per place, before it is said that goals exclude each other
LOOKS = 20_000  # at partial combinations of these
ENDS = 4  # combinations that a search may choose from

Choice = tuple[int, ...]  # a number of a posture for each place

FEW = 4  # robots that plan together at first
RESTARTS = 4  # searches of all robots together
FINEST, COARSEST = 2e-3, 0.01  # m; between places that are checked: the clearance, if within
RADIANS_PER_METRE = 5.0  # how far links may turn between two of them, beside how far they travel


def find_goal_configurations(
    targets: Sequence[PlaceGoal], clearances: Clearances, base: Floats, time: float
) -> Floats:
    """Return all coordinates at some combinations of goals, best first, (n, D).

    Those that keep the clearance come first.

    Args:
        targets: What each place is to do.
        clearances: Who keeps how far from what.
        base: All coordinates at the end, but for the targets', (D,) (rad, m).
        time: When that is (s).

    Raises:
        NoPlanError: If something overlaps in all of them.
    """
    return _PathSearch(targets, clearances, base, time).found()


class _PathSearch:
    def __init__(
        self, targets: Sequence[PlaceGoal], clearances: Clearances, base: Floats, time: float
    ) -> None:
        self._targets, self._clearances, self._base, self._time = targets, clearances, base, time

    def found(self) -> Floats:
        known = [self._alone(target) for target in self._targets]
        first = list(islice(choices([len(postures) for postures in known]), COMBINATIONS))
        states = self._states(known, first)
        free = self._free(states)
        if not free.any():
            contact = self._clearances.overlaps().contact(states[0], self._time)
            states = self._searched(known)
            free = self._free(states)
            if not free.any():
                who = " and ".join(target.place for target in self._targets)
                raise NoPlanError(
                    f"the goals of {who} exclude each other: there {contact}", "goal in collision"
                )
        wide = self._clearances.checker(self._robots()).free(states[free], self._time)
        return states[free][np.argsort(~wide, kind="stable")][:ENDS]

    def _alone(self, target: PlaceGoal) -> Floats:
        """Return postures in which a robot touches nothing but what moves, too, (n, d).

        Raises:
            NoPlanError: If it does so in all that are known, and in all that a longer search finds.
        """
        if sum(other.robot == target.robot for other in self._targets) > 1:
            return target.candidates[:CANDIDATES]
        free = self._clear(target, target.candidates)
        if not len(free):
            free = self._clear(target, target.others())
        if not len(free):
            state = self._with(target, target.candidates[:1])[0]
            contact = self._clearances.overlaps(self._besides(target)).contact(state, self._time)
            raise NoPlanError(
                f"at the goal of {target.place}, {target.goal}, {contact}", "goal in collision"
            )
        return free[:CANDIDATES]

    def _clear(self, target: PlaceGoal, postures: Floats) -> Floats:
        """Return those of a robot's postures that are free; first what keeps the clearance."""
        besides, states = self._besides(target), self._with(target, postures)
        free = self._clearances.overlaps(besides).free(states, self._time)
        checker = self._clearances.checker([target.robot], besides)
        return postures[free][np.argsort(~checker.free(states[free], self._time), kind="stable")]

    def _searched(self, known: Sequence[Floats]) -> Floats:
        """Return one combination of many more postures in which no two are in conflict, (1, D).

        There may be none, (0, D).
        """
        postures = [
            different(np.concatenate([own, self._more(target)]))[:MORE]
            for own, target in zip(known, self._targets, strict=True)
        ]
        agree = {
            pair: self._agreeing(pair, postures) for pair in combinations(range(len(postures)), 2)
        }
        looks = [LOOKS]

        def extended(choice: Choice) -> Choice | None:
            place = len(choice)
            if place == len(postures):
                return choice
            for i in range(len(postures[place])):
                looks[0] -= 1
                if looks[0] >= 0 and all(agree[j, place][c, i] for j, c in enumerate(choice)):
                    whole = extended((*choice, i))
                    if whole is not None:
                        return whole
            return None

        choice = extended(())
        return self._states(postures, [] if choice is None else [choice])

    def _more(self, target: PlaceGoal) -> Floats:
        others = target.others()
        if sum(other.robot == target.robot for other in self._targets) > 1:
            return others
        return self._clear(target, others)

    def _agreeing(self, pair: tuple[int, int], postures: Sequence[Floats]) -> NDArray[np.bool_]:
        """Tell which postures of two places go together, (n, m)."""
        one, other = (self._targets[i] for i in pair)
        counts = [len(postures[i]) for i in pair]
        states = np.tile(self._base, (*counts, 1))
        states[..., one.moving] = postures[pair[0]][:, None]
        states[..., other.moving] = postures[pair[1]][None]
        ignored = [name for name in self._robots() if name not in (one.robot, other.robot)]
        free = self._clearances.overlaps(ignored).free(
            states.reshape(-1, len(self._base)), self._time
        )
        return free.reshape(counts)

    def _states(self, postures: Sequence[Floats], chosen: Sequence[Choice]) -> Floats:
        states = np.tile(self._base, (len(chosen), 1))
        for i, target in enumerate(self._targets):
            states[:, target.moving] = postures[i][[choice[i] for choice in chosen]]
        return states

    def _with(self, target: PlaceGoal, postures: Floats) -> Floats:
        states = np.tile(self._base, (len(postures), 1))
        states[:, target.moving] = postures
        return states

    def _free(self, states: Floats) -> NDArray[np.bool_]:
        return self._clearances.overlaps().free(states, self._time)

    def _robots(self) -> tuple[str, ...]:
        """Return the robots that move, in the layout's order."""
        moving = {target.robot for target in self._targets}
        return tuple(name for name in self._clearances.cell.robots if name in moving)

    def _besides(self, target: PlaceGoal) -> list[str]:
        """Return the robots that move besides a target's."""
        return [other.robot for other in self._targets if other.robot != target.robot]


def choices(counts: Sequence[int]) -> Iterator[Choice]:
    """Yield a number below each of some counts, those first whose sum is least."""
    for total in range(sum(counts) - len(counts) + 1):
        yield from _choices(counts, total)


def _choices(counts: Sequence[int], total: int) -> Iterator[Choice]:
    if not counts:
        yield ()
        return
    left = sum(counts[1:]) - len(counts[1:])
    for first in range(max(0, total - left), min(counts[0] - 1, total) + 1):
        for rest in _choices(counts[1:], total - first):
            yield first, *rest


@dataclass(eq=False)
class Query:
    """What is asked, with everything that it takes to answer it.

    Attributes:
        cell: The cell.
        start: Where all coordinates are at the start, (D,) (rad, m).
        targets: What each place is to do.
        dynamic_obstacles: What moves along known trajectories.
        clearances: Who keeps how far from what.
        speeds: Largest speeds of all coordinates, (D,) (rad/s, m/s).
        clearance: How far robots keep from everything (m).
        seed: Of everything random.
        progress: What counts the checks.
    """

    cell: Cell
    start: Floats
    targets: tuple[PlaceGoal, ...]
    dynamic_obstacles: CellTrajectory
    clearances: Clearances
    speeds: Floats
    clearance: float
    seed: int
    progress: Progress

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots that move, in the layout's order."""
        moving = {target.robot for target in self.targets}
        return tuple(name for name in self.cell.robots if name in moving)

    @property
    def resolution(self) -> Resolution:
        """How dense checks make sure that nothing comes nearer than 0 in between."""
        step = min(max(self.clearance, FINEST), COARSEST)
        return step, RADIANS_PER_METRE * step

    def ends(self) -> Floats:
        """Return all coordinates at some combinations of goals, best first, (n, D).

        Those that keep the clearance come first. For bodies that are nearer at the start or at
        the first of them the clearance is given up.

        Raises:
            NoPlanError: If the start collides, or all goals do.
        """
        self.clearances.expect_free_start(self.start)
        self.clearances.relax(self.start)
        return self._ends(self.targets)

    def reachable_ends(self) -> Floats:
        """Return what `ends` does, of postures that are not known to be cut off from the start.

        Raises:
            NoPlanError: If there are none; all of a goal are cut off, or all others collide.
        """
        return self._ends([self._reachable(target) for target in self.targets])

    def _ends(self, targets: Sequence[PlaceGoal]) -> Floats:
        end = self.dynamic_obstacles.end
        base = self.dynamic_obstacles.positions(end)
        ends = find_goal_configurations(targets, self.clearances, base, end)
        self.clearances.relax(ends[0], end)
        return ends

    def _reachable(self, target: PlaceGoal) -> PlaceGoal:
        """Return a target without the postures that are cut off.

        Raises:
            NoPlanError: If all are.
        """
        postures = different(np.concatenate([target.candidates, target.others()]))
        goals = np.tile(self.start, (len(postures), 1))
        goals[:, target.moving] = postures
        proofs = list(map(self.proofs.before, goals))
        kept = [proof is None for proof in proofs]
        if proofs[0] is not None and not any(kept):
            raise proofs[0].refusal()
        none = np.empty((0, len(target.moving)))
        return replace(target, candidates=postures[kept], others=lambda: none)

    @cached_property
    def proofs(self) -> InfeasibilityProofs:
        """What may cut goals off from the start."""
        moving = np.concatenate([target.moving for target in self.targets])
        return InfeasibilityProofs(self.cell, self.clearances.standing, self.start, moving)

    def path(
        self, ends: Floats, when: float | None = None, robots: Collection[str] | None = None
    ) -> tuple[Space, Path]:
        """Return the space of all coordinates that move, and the way through it.

        Args:
            ends: What `ends` returned.
            when: The moment at which dynamic obstacles are taken to stand still (s); None ignores
                them.
            robots: Those that are to move, as if the others that have a goal were not there; None
                is all.

        Raises:
            NoPlanError: If there is none, or the time given is over.
        """
        chosen = self.robots if robots is None else tuple(r for r in self.robots if r in robots)
        ignored = [name for name in self.robots if name not in chosen]
        moving = np.sort(np.concatenate([t.moving for t in self.targets if t.robot in chosen]))
        base = self.start if when is None else self.dynamic_obstacles.positions(when)
        space = Space(
            self.cell,
            chosen,
            moving,
            base,
            _bounds(self.cell.limits[moving], self.start[moving], ends[:, moving]),
            self.speeds[moving],
            self.clearances.checker(chosen, ignored, timed=when is not None),
            self.progress,
            when=when,
            proofs=self.proofs,
        )
        free = space.are_free(ends[:, moving])
        points = self._points(space, list(ends[free][:, moving])) if free.any() else None
        if points is None:
            raise self._not_found(chosen)
        space.purpose = "shortening"
        points = shortened(space, points, self.seed, self.resolution)
        return space, rounded(space, points, self.resolution)

    def _points(self, space: Space, goals: Sequence[Floats]) -> Floats | None:
        """Return points of a free path: few robots plan together, many alone at first."""
        start = self.start[space.free]
        together = partial(connect, space, start, goals, self.seed, self.resolution)
        few = len(space.robots) <= FEW
        points = together(restarts=int(few))
        if points is None and len(space.robots) > 1:
            points = Coordination(
                space, self.clearances, start, goals[0], self.seed, self.resolution
            ).run()
        return together(first=int(few), restarts=RESTARTS) if points is None else points

    def _not_found(self, robots: Collection[str]) -> NoPlanError:
        who = ", ".join(target.place for target in self.targets if target.robot in robots)
        return NoPlanError(
            f"no motion of {who} was found in {self.progress.told} checks; another seed, a"
            " smaller clearance or another posture at the goal may help",
            "not found",
        )


def _bounds(limits: Floats, start: Floats, ends: Floats) -> Floats:
    """Return where a search may go: the limits, or around start and goals where there are none."""
    around = np.concatenate([start[None], ends])
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], around.min(axis=0) - np.pi)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], around.max(axis=0) + np.pi)
    return np.stack([low, high], axis=1)
