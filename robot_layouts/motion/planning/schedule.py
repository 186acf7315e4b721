"""When each robot moves: together, at its own pace, or after dynamic obstacles have passed."""

from __future__ import annotations

from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.planning.infeasibility import CUT_OFF
from robot_layouts.motion.planning.query import Query
from robot_layouts.motion.planning.space import Progress, Resolution, Space
from robot_layouts.motion.timing.paths import Path
from robot_layouts.motion.timing.trajectories import CellTrajectory, JointTrajectory
from robot_layouts.motion.timing.velocities import STEP, timed

LATER = 10 * STEP  # s; how much later a motion is tried next
SPARE = 2.0  # s; how long after everything else stands still a motion may set out


def schedule(query: Query, accelerations: Floats, *, synchronised: bool) -> CellTrajectory:
    """Return everything over time: what was planned, and what moves along a known trajectory.

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


def _to_ends(
    query: Query, ends: Floats, accelerations: Floats, *, synchronised: bool
) -> CellTrajectory:
    if not synchronised and len(query.robots) > 1:
        scheduled = _each_alone(query, ends, accelerations)
        if scheduled is not None:
            return scheduled
    if query.dynamic_obstacles.end == 0.0:
        return query.dynamic_obstacles.with_trajectory(
            _trajectory(*query.path(ends), accelerations)
        )
    return _past_dynamic_obstacles(query, ends, accelerations)


def _past_dynamic_obstacles(query: Query, ends: Floats, accelerations: Floats) -> CellTrajectory:
    """Plan past what moves, taken to stand still at some moment, and set out when that is free.

    Raises:
        NoPlanError: If that succeeds at no moment.
    """
    known, checker = query.dynamic_obstacles, query.clearances.checker(query.robots)
    reason = NoPlanError(
        f"{', '.join(query.robots)} can get to their goals, but no moment to set out was found at"
        " which what moves along a known trajectory is out of the way",
        "not found",
    )
    for when in (None, known.end, 0.0, known.end / 2):
        try:
            trajectory = _trajectory(*query.path(ends, when), accelerations)
        except NoPlanError as error:
            query.progress.tell("looking for another way")
            reason = error if when is None else reason
            continue
        free = earliest_start(known, trajectory, checker, query.resolution, query.progress)
        if free is not None:
            return known.with_trajectory(free)
    raise reason


def _each_alone(query: Query, ends: Floats, accelerations: Floats) -> CellTrajectory | None:
    """Let each robot go as fast as it can alone, later where it must wait for those before it.

    A robot that finds no moment to set out goes first, once; None if it finds none then, either.

    Raises:
        NoPlanError: If a robot finds no way even alone.
    """
    waiting = [
        (name, _trajectory(*query.path(ends[:1], robots=[name]), accelerations))
        for name in query.robots
    ]
    promoted: set[str] = set()
    while True:
        scheduled, stuck = _one_by_one(query, waiting)
        if stuck is None:
            return scheduled
        if waiting[stuck][0] in promoted:
            return None
        promoted.add(waiting[stuck][0])
        waiting.insert(0, waiting.pop(stuck))


def _one_by_one(
    query: Query, waiting: list[tuple[str, JointTrajectory]]
) -> tuple[CellTrajectory, int | None]:
    """Send robots off in an order; return everything over time, or who finds no moment to go."""
    scheduled = query.dynamic_obstacles
    for i, (name, trajectory) in enumerate(waiting):
        later = [other for other, _ in waiting[i + 1 :]]
        checker = query.clearances.checker([name], later)
        free = earliest_start(scheduled, trajectory, checker, query.resolution, query.progress)
        if free is None:
            return scheduled, i
        scheduled = scheduled.with_trajectory(free)
    return scheduled, None


def _trajectory(space: Space, path: Path, accelerations: Floats) -> JointTrajectory:
    return JointTrajectory(space.free, *timed(path, accelerations[space.free]))


def earliest_start(
    known: CellTrajectory,
    trajectory: JointTrajectory,
    checker: Checker,
    resolution: Resolution,
    progress: Progress,
) -> JointTrajectory | None:
    """Return a trajectory delayed until it collides with nothing, or None.

    Args:
        known: What moves along a known trajectory.
        trajectory: What may set out later.
        checker: Tells what must not come near to what.
        resolution: How far things may move between two moments that are checked.
        progress: What counts the checks.

    Raises:
        NoPlanError: If the time given is over.
    """
    for i in range(int((known.end + SPARE) / LATER) + 1):
        progress.tell("waiting for others")
        tried = trajectory.later(i * LATER)
        if _is_free(known.with_trajectory(tried), checker, resolution):
            return tried
    return None


def _is_free(known: CellTrajectory, checker: Checker, resolution: Resolution) -> bool:
    times = known.knots()
    states = known.positions(times)
    if not checker.free(states, times).all():
        return False
    return all(
        checker.edge_free(states[i], states[i + 1], resolution, (times[i], times[i + 1]))
        for i in range(len(times) - 1)
    )
