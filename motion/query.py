"""One question to the planner: from a start to goals, past what stands still at one moment."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from kinematics.rotations import Floats
from motion.cell import Cell
from motion.clearances import Keeping
from motion.goals import CANDIDATES, Target
from motion.paths import Path
from motion.priorities import coordinated
from motion.search import connect
from motion.shorten import rounded, shortened
from motion.spaces import Progress, Resolution, Space
from motion.traffic import Traffic
from robots.common.errors import NoPlanError

FEW = 4  # robots that plan together at first
RESTARTS = 4  # searches of all robots together
COMBINATIONS = 512  # of postures of all places that are tried as goals
ENDS = 4  # of them that a search may choose from
FINEST = 2e-3  # m; how near places are that are looked at, where no clearance is asked
RADIANS_PER_METRE = 5.0  # how far links may turn between two of them, beside how far they travel


@dataclass(eq=False)
class Query:
    """What is asked, with everything that it takes to answer it.

    Attributes:
        cell: The cell.
        start: Where all coordinates are at the start, (D,) (rad, m).
        targets: What each place is to do.
        traffic: What moves as it was told.
        keeping: Who keeps how far from what.
        speeds: Largest speeds of all coordinates, (D,) (rad/s, m/s).
        clearance: How far robots keep from everything (m).
        seed: Of everything random.
        progress: What counts the checks.
    """

    cell: Cell
    start: Floats
    targets: tuple[Target, ...]
    traffic: Traffic
    keeping: Keeping
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
        step = max(self.clearance, FINEST)
        return step, RADIANS_PER_METRE * step

    def ends(self) -> Floats:
        """Return all coordinates at some combinations of goals, best first, (n, D).

        Those that keep the clearance come first. For bodies that are nearer at the start or at
        the first of them the clearance is given up.

        Raises:
            NoPlanError: If the start collides, or all goals do.
        """
        self.keeping.expect_free_start(self.start)
        self.keeping.relax(self.start)
        ends = self._combined({target.place: self._candidates(target) for target in self.targets})
        self.keeping.relax(ends[0], self.traffic.end)
        return ends

    def path(
        self, ends: Floats, when: float | None = None, robots: Collection[str] | None = None
    ) -> tuple[Space, Path]:
        """Return the space of all coordinates that move, and the way through it.

        Args:
            ends: What `ends` returned.
            when: The moment at which what moves as it was told is taken to stand still (s); None
                looks past all that.
            robots: Those that are to move, as if the others that have a goal were not there; None
                is all.

        Raises:
            NoPlanError: If there is none, or the time given is over.
        """
        chosen = self.robots if robots is None else tuple(r for r in self.robots if r in robots)
        ignored = [name for name in self.robots if name not in chosen]
        moving = np.sort(np.concatenate([t.moving for t in self.targets if t.robot in chosen]))
        base = self.start if when is None else self.traffic.positions(when)
        space = Space(
            self.cell,
            chosen,
            moving,
            base,
            _bounds(self.cell.limits[moving], self.start[moving], ends[:, moving]),
            self.speeds[moving],
            self.keeping.checker(chosen, ignored, timed=when is not None),
            self.progress,
            when=when,
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
            points = coordinated(space, self.keeping, start, goals[0], self.seed, self.resolution)
        return together(first=int(few), restarts=RESTARTS) if points is None else points

    def _candidates(self, target: Target) -> Floats:
        """Return the postures in which a robot touches nothing but what moves, too, (n, d)."""
        if sum(other.robot == target.robot for other in self.targets) > 1:
            return target.candidates[:CANDIDATES]
        others = [other.robot for other in self.targets if other.robot != target.robot]
        states = self._at_end(len(target.candidates))
        states[:, target.moving] = target.candidates
        overlaps = self.keeping.overlaps(others)
        free = overlaps.free(states, self.traffic.end)
        if not free.any():
            contact = overlaps.contact(states[0], self.traffic.end)
            raise NoPlanError(
                f"at the goal of {target.place}, {target.goal}, {contact}", "goal in collision"
            )
        wide = self.keeping.checker([target.robot], others).free(states[free], self.traffic.end)
        return target.candidates[free][np.argsort(~wide, kind="stable")][:CANDIDATES]

    def _combined(self, candidates: dict[str, Floats]) -> Floats:
        counts = [range(len(candidates[target.place])) for target in self.targets]
        chosen = sorted(product(*counts), key=lambda choice: (sum(choice), choice))[:COMBINATIONS]
        states = self._at_end(len(chosen))
        for i, target in enumerate(self.targets):
            postures = candidates[target.place][[choice[i] for choice in chosen]]
            states[:, target.moving] = postures
        free = self.keeping.overlaps().free(states, self.traffic.end)
        if not free.any():
            contact = self.keeping.overlaps().contact(states[0], self.traffic.end)
            who = " and ".join(target.place for target in self.targets)
            raise NoPlanError(
                f"the goals of {who} exclude each other: there {contact}", "goal in collision"
            )
        wide = self.keeping.checker(self.robots).free(states[free], self.traffic.end)
        return states[free][np.argsort(~wide, kind="stable")][:ENDS]

    def _at_end(self, count: int) -> Floats:
        """Return where everything is once all that moves as it was told has stopped, (count, D)."""
        return np.tile(self.traffic.positions(self.traffic.end), (count, 1))

    def _not_found(self, robots: Collection[str]) -> NoPlanError:
        who = ", ".join(target.place for target in self.targets if target.robot in robots)
        return NoPlanError(
            f"no motion of {who} was found in {self.progress.checks} checks; another seed, a"
            " smaller clearance or another posture at the goal may help",
            "not found",
        )


def _bounds(limits: Floats, start: Floats, ends: Floats) -> Floats:
    """Return where a search may go: the limits, or around start and goals where there are none."""
    around = np.concatenate([start[None], ends])
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], around.min(axis=0) - np.pi)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], around.max(axis=0) + np.pi)
    return np.stack([low, high], axis=1)
