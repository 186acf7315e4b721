"""When who moves: all together, each at its own pace, and past what moves as it was told."""

from __future__ import annotations

from kinematics.rotations import Floats
from motion.barriers import CUT_OFF
from motion.paths import Path
from motion.query import Query
from motion.spaces import Space
from motion.timing import timed
from motion.traffic import Course, Traffic, first_free
from robots.common.errors import NoPlanError


def carried_out(query: Query, accelerations: Floats, *, synchronised: bool) -> Traffic:
    """Return everything over time: what was planned, and what moves as it was told.

    Args:
        query: What is asked.
        accelerations: Largest ones of all coordinates, (D,) (rad/s², m/s²).
        synchronised: Whether all robots set out and arrive together. If not, each goes at its own
            pace, if they can keep clear of each other so.

    Raises:
        NoPlanError: If there is no motion, or none was found.
    """
    try:
        return _to_ends(query, query.ends(), accelerations, synchronised=synchronised)
    except NoPlanError as error:
        if error.reason != CUT_OFF:
            raise
        ends = query.reachable_ends()
        return _to_ends(query, ends, accelerations, synchronised=synchronised)


def _to_ends(query: Query, ends: Floats, accelerations: Floats, *, synchronised: bool) -> Traffic:
    if not synchronised and len(query.robots) > 1:
        traffic = _each_alone(query, ends, accelerations)
        if traffic is not None:
            return traffic
    if query.traffic.end == 0.0:
        return query.traffic.with_course(_course(*query.path(ends), accelerations))
    return _past_traffic(query, ends, accelerations)


def _past_traffic(query: Query, ends: Floats, accelerations: Floats) -> Traffic:
    """Plan past what moves, taken to stand still at some moment, and set out when that is free.

    Raises:
        NoPlanError: If that succeeds at no moment.
    """
    traffic, checker = query.traffic, query.keeping.checker(query.robots)
    reason = NoPlanError(
        f"{', '.join(query.robots)} can get to their goals, but no moment to set out was found at"
        " which what moves as it was told is out of the way",
        "not found",
    )
    for when in (None, traffic.end, 0.0, traffic.end / 2):
        try:
            course = _course(*query.path(ends, when), accelerations)
        except NoPlanError as error:
            query.progress.tell("looking for another way")
            reason = error if when is None else reason
            continue
        free = first_free(traffic, course, checker, query.resolution, query.progress)
        if free is not None:
            return traffic.with_course(free)
    raise reason


def _each_alone(query: Query, ends: Floats, accelerations: Floats) -> Traffic | None:
    """Let each robot go as fast as it can alone, later where it must wait for those before it.

    A robot that finds no moment to set out goes first, once; None if it finds none then, either.

    Raises:
        NoPlanError: If a robot finds no way even alone.
    """
    waiting = [
        (name, _course(*query.path(ends[:1], robots=[name]), accelerations))
        for name in query.robots
    ]
    promoted: set[str] = set()
    while True:
        traffic, stuck = _one_by_one(query, waiting)
        if stuck is None:
            return traffic
        if waiting[stuck][0] in promoted:
            return None
        promoted.add(waiting[stuck][0])
        waiting.insert(0, waiting.pop(stuck))


def _one_by_one(query: Query, waiting: list[tuple[str, Course]]) -> tuple[Traffic, int | None]:
    """Send robots off in an order; return everything over time, or who finds no moment to go."""
    traffic = query.traffic
    for i, (name, course) in enumerate(waiting):
        later = [other for other, _ in waiting[i + 1 :]]
        checker = query.keeping.checker([name], later)
        free = first_free(traffic, course, checker, query.resolution, query.progress)
        if free is None:
            return traffic, i
        traffic = traffic.with_course(free)
    return traffic, None


def _course(space: Space, path: Path, accelerations: Floats) -> Course:
    return Course(space.free, *timed(path, accelerations[space.free]))
