"""Many robots: each plans alone, then they wait for each other, and who cannot plan together.

Robots, or groups of them, first find paths as if the others that move were not there. Then one
after the other gets a schedule along its path, forwards, waiting or back, so that it keeps clear
of those before it. Who finds none goes first; who finds none then, either, joins the group that is
most in the way, and both plan one path together.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Clearances
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.planning.rrt_connect import COARSE, connect
from robot_layouts.motion.planning.shortcuts import shortened
from robot_layouts.motion.planning.space import Resolution, Space
from robot_layouts.motion.timing.paths import way, without_straight_points

ALONE = 3  # searches of a path of a robot alone
TICK = 0.12  # s at full speed; how far a robot gets along its path between two decisions
EXPANSIONS = 3000  # places and times that a schedule may expand
SLACK = 3  # a schedule may take so many times as long as all paths one after the other, by ticks

_Pair = tuple[tuple[str, ...], tuple[str, ...]]  # the robots of two groups
Step = tuple[int, int]  # from one place on a path to the next, or the same


@dataclass(eq=False)
class _Group:
    """Robots that follow one path together.

    Attributes:
        space: Their coordinates, kept clear of everything but the others that move.
        columns: Of these coordinates, among those of all that move.
        places: On their path, a tick apart, (n, d).
        schedule: The place at each tick.
        promoted: How often it was put first.
    """

    space: Space
    columns: NDArray[np.intp]
    places: Floats
    schedule: list[int] = field(default_factory=list)
    promoted: int = 0

    def at(self, tick: int) -> int:
        """Return the place at a tick."""
        return self.schedule[min(tick, len(self.schedule) - 1)]


@dataclass(eq=False)
class Coordination:
    """A search in which each robot plans alone, and then they wait for each other.

    Attributes:
        space: The coordinates of all robots that move.
        clearances: What has to keep clear of what.
        start: (d,) (rad, m).
        goal: (d,) (rad, m).
        seed: Of everything random.
        resolution: Of the path.
    """

    space: Space
    clearances: Clearances
    start: Floats
    goal: Floats
    seed: int
    resolution: Resolution
    _meetings: dict[_Pair, _Meeting] = field(default_factory=dict)

    def run(self) -> Floats | None:
        """Return points of a free path of all robots from the start to the goal, or None.

        Raises:
            NoPlanError: If one robot finds no path even alone, or the time given is over.
        """
        groups = [self._alone(name) for name in self.space.robots]
        while len(groups) > 1:
            stuck = self._schedule(groups)
            if stuck is None:
                return self._points(groups)
            group = groups[stuck]
            if group.promoted == 0:
                group.promoted = 1
                groups.insert(0, groups.pop(stuck))
                continue
            other = self._most_in_the_way(group, groups[:stuck])
            merged = self._group((*group.space.robots, *other.space.robots))
            if merged is None:
                return None
            groups = [merged, *(g for g in groups if g is not group and g is not other)]
        return None  # planning all together is not the matter of this module

    def _alone(self, robot: str) -> _Group:
        """Plan a path of one robot without the others that move.

        Raises:
            NoPlanError: If none is found; then there is none of all robots, either.
        """
        group = self._group((robot,), ALONE)
        if group is None:
            raise NoPlanError(
                f"no motion of {robot} was found in {self.space.progress.told} checks, even if"
                " the other robots that move were not there",
                "not found",
            )
        return group

    def _group(self, robots: tuple[str, ...], restarts: int = 2) -> _Group | None:
        """Plan a path of some robots, in the layout's order, without the others that move."""
        robots = tuple(name for name in self.space.robots if name in robots)
        if len(robots) == len(self.space.robots) > 1:
            return None
        others = [name for name in self.space.robots if name not in robots]
        part = self.space.part(robots, self._checker(robots, others))
        columns = self.space.columns(robots)
        start, goal = self.start[columns], self.goal[columns]
        points = connect(part, start, [goal], self.seed, self.resolution, restarts=restarts)
        if points is None:
            return None
        if len(points) > 2:
            points = shortened(part, points, self.seed, self.resolution)
        return _Group(part, columns, _places(points, part.speeds))

    def _checker(self, robots: Sequence[str], others: Sequence[str]) -> Checker:
        return self.clearances.checker(robots, others, timed=self.space.when is not None)

    # -- schedules -----------------------------------------------------------------------------

    def _schedule(self, groups: Sequence[_Group]) -> int | None:
        """Give all groups a schedule; return the first that finds none, or None."""
        for i, group in enumerate(groups):
            if not self._find(group, groups[:i]):
                return i
        return None

    def _find(self, group: _Group, before: Sequence[_Group]) -> bool:
        """Find when a group is where, by A*; those before keep to their schedules."""
        last = len(group.places) - 1
        settled = max((len(other.schedule) for other in before), default=1) - 1
        latest = SLACK * (settled + last)
        came: dict[tuple[int, int], int] = {(0, 0): 0}
        waiting = [(last, 0, 0, 0)]  # ticks at least, how far still, place, tick
        for _ in range(EXPANSIONS):
            if not waiting:
                return False
            _, _, at, tick = heapq.heappop(waiting)
            if at == last and self._stays(group, before, tick, settled):
                group.schedule = list(_traced(came, at, tick))
                return True
            if tick >= latest:
                continue
            for to in (at + 1, at, at - 1):
                if 0 <= to <= last and (to, tick + 1) not in came:
                    if self._free(group, (at, to), before, tick):
                        came[to, tick + 1] = at
                        heapq.heappush(waiting, (tick + 1 + last - to, last - to, to, tick + 1))
        return False

    def _stays(self, group: _Group, before: Sequence[_Group], tick: int, settled: int) -> bool:
        """Tell whether a group that is at its goal can stay there."""
        last = len(group.places) - 1
        return all(self._free(group, (last, last), before, t) for t in range(tick, settled))

    def _free(self, group: _Group, step: Step, before: Sequence[_Group], tick: int) -> bool:
        return all(
            self._meeting(group, other).free(step, (other.at(tick), other.at(tick + 1)))
            for other in before
        )

    def _meeting(self, group: _Group, other: _Group) -> _Meeting:
        key = group.space.robots, other.space.robots
        if key not in self._meetings:
            both = self.space.part((*key[0], *key[1]), self.clearances.between(*key))
            self._meetings[key] = _Meeting(both, group, other)
        return self._meetings[key]

    def _most_in_the_way(self, group: _Group, before: Sequence[_Group]) -> _Group:
        counts = Counter({i: self._meeting(group, o).obstructions() for i, o in enumerate(before)})
        return before[max(counts, key=lambda i: (counts[i], -i))]

    def _points(self, groups: Sequence[_Group]) -> Floats | None:
        """Return the path of all along their schedules, if it is free at the finer resolution."""
        ticks = max(len(group.schedule) for group in groups)
        points = np.empty((ticks, len(self.start)))
        for group in groups:
            points[:, group.columns] = group.places[[group.at(tick) for tick in range(ticks)]]
        points = without_straight_points(points, self.space.speeds)
        return points if self.space.path_free(points, self.resolution) else None


class _Meeting:
    """Two groups on their paths: which steps they may take at the same time."""

    def __init__(self, space: Space, one: _Group, other: _Group) -> None:
        self._space, self._one, self._other = space, one, other
        self._known: dict[tuple[Step, Step], bool] = {}
        self._columns = space.columns(one.space.robots), space.columns(other.space.robots)

    def free(self, step: Step, other: Step) -> bool:
        key = step, other
        if key not in self._known:
            a, b = self._place(step[0], other[0]), self._place(step[1], other[1])
            self._known[key] = self._space.edge_free(a, b, COARSE)
        return self._known[key]

    def obstructions(self) -> int:
        """Return how many steps were found to be obstructed."""
        return sum(not free for free in self._known.values())

    def _place(self, own: int, other: int) -> Floats:
        place = np.empty(len(self._space.free))
        place[self._columns[0]] = self._one.places[own]
        place[self._columns[1]] = self._other.places[other]
        return place


def _places(points: Floats, speeds: Floats) -> Floats:
    """Return places on a path a tick apart at most, with all its points, (n, d)."""
    counts = np.maximum(np.ceil(way(points, speeds) / TICK), 1).astype(int)
    parts = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(points[:-1], points[1:], counts.tolist(), strict=True)
    ]
    return np.concatenate([*parts, points[-1:]])


def _traced(came: dict[tuple[int, int], int], at: int, tick: int) -> Iterator[int]:
    places = [at]
    while tick > 0:
        at, tick = came[at, tick], tick - 1
        places.append(at)
    return reversed(places)
