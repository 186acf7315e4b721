"""Planning: from a layout, a start and goals to a motion that collides with nothing.

Robots move together, or each at its own pace, and after dynamic obstacles have passed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from layouts import Layout
from layouts.frames import Rectangle
from robot_layouts.core.bounds import FAR, checked_number, checked_numbers, checked_whole, shown
from robot_layouts.core.errors import MotionError, NoPlanError
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell, Clearances, cell_of
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.model.bodies import checked_table
from robot_layouts.motion.model.obstacles import Held, Obstacle
from robot_layouts.motion.motion import Motion
from robot_layouts.motion.planning.goals import Goal, PlaceGoal, read_targets
from robot_layouts.motion.planning.infeasibility import CUT_OFF
from robot_layouts.motion.planning.query import Query
from robot_layouts.motion.planning.space import Resolution, Space
from robot_layouts.motion.timing.paths import Path
from robot_layouts.motion.timing.trajectories import CellTrajectory, JointTrajectory
from robot_layouts.motion.timing.velocities import (
    STEP,
    Accelerations,
    largest_accelerations,
    largest_velocities,
    timed,
)

LATER = 10 * STEP  # s; how much later a motion is tried next
SPARE = 2.0  # s; how long after everything else stands still a motion may set out


def plan(
    layout: Layout,
    start: Mapping[str, ArrayLike] | ArrayLike | None = None,
    goals: Mapping[str, Goal] | None = None,
    *,
    obstacles: Iterable[Obstacle] = (),
    held: Iterable[Held] = (),
    table: Rectangle | None = None,
    others: Mapping[str, Motion] | None = None,
    clearance: float = 0.01,
    seed: int = 0,
    patience: float = 30.0,
    synchronised: bool = True,
    control_mode: str | Mapping[str, str] | None = None,
    velocity: float = 1.0,
    acceleration: Accelerations | None = None,
) -> Motion:
    """Return a motion that brings places of a layout to their goals without a collision.

    Robots, or limbs of robots, that have no goal stay where they are; so do grippers, heads and
    mobile bases. The same arguments give the same motion, on every machine.

    Args:
        layout: Which robots stand where.
        start: Joint positions of some robots, by name, the others being where the layout starts
            them; or of all robots one after the other, (D,) (rad, m).
        goals: By place (a robot or a limb): the joint positions of its arm, or of all its joints
            (rad, m); a `TcpGoal`, or a `RegionGoal`.
        obstacles: What else stands in the way.
        held: What arms hold, and carry along.
        table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m), besides
            those of the layout.
        others: Motions of some robots by name, which move along them; the plan waits
            for them, or finds a way round.
        clearance: How far robots stay from each other and from everything else (m). Bodies that
            are nearer at the start or at the goal only have to stay apart, and so do links of one
            robot.
        seed: Of everything random.
        patience: How long planning may take (s). It never changes a motion, only whether there is
            one.
        synchronised: Whether all robots set out and arrive together, at the pace of the slowest.
            If not, each goes at its own pace, and some set out later where that keeps them apart;
            where that does not, either, they go together.
        control_mode: In which the motion will be executed; None for that of the layout. See
            `robot_layouts.motion.timing.velocities.largest_velocities`.
        velocity: Share of the largest velocities to use, over 0, at most 1.
        acceleration: Largest accelerations (rad/s², m/s²), one for all joints or by robot; by
            default joints get to their largest velocity in 0.4 s.

    Returns:
        The motion, of all robots.

    Raises:
        AssetError: If a robot's files cannot be found or are invalid.
        LayoutError: If obstacles or the table are invalid.
        MissingPackageError: If the extra ``motion`` is not installed.
        MotionError: If another argument is invalid.
        NoPlanError: If there is no such motion, or none was found; ``reason`` says why.
        UnknownNameError: If there is no such place.
    """
    checked_whole("seed", seed, 0, 2**31, MotionError)
    patience = checked_number("patience", patience, 1e-3, 1e6, MotionError, "s")
    clearance = checked_number("clearance", clearance, 0.0, 1.0, MotionError, "m")
    table = checked_table(table)
    cell = cell_of(layout, obstacles, held, table)
    here = _start(cell, start)
    velocities = largest_velocities(layout, control_mode, velocity)
    accelerations = largest_accelerations(layout, velocities, acceleration)
    others = {} if others is None else others
    known = _dynamic_obstacles(cell, here, others)
    targets = read_targets(cell, goals or {}, here)
    query = Query(
        cell,
        here,
        targets,
        known,
        Clearances(cell, _robots(targets, others), clearance, others),
        _all(cell, velocities),
        clearance,
        seed,
        _progress(patience),
    )
    result = _schedule(query, _all(cell, accelerations), synchronised=synchronised)
    times = result.knots()
    return Motion(
        layout=layout,
        times=times,
        positions=_by_robot(cell, result.positions(times)),
        velocities=_by_robot(cell, result.velocities(times)),
        obstacles=cell.obstacles,
        held=cell.held,
        table=table,
        clearance=clearance,
        largest_velocities=velocities,
        largest_accelerations=accelerations,
    )


def _progress(patience: float) -> Progress:
    """Return what counts checks, and ends a plan that takes longer than that (s)."""

    def late(what: str) -> NoPlanError:
        return NoPlanError(
            f"no motion was found in the {patience:g} s given, after {progress.told} checks; the"
            f" last step was {what}. Give it more time by patience=…",
            "not found",
        )

    progress = Progress(work="planning", seconds=patience, late=late)
    return progress


def _robots(targets: Sequence[PlaceGoal], others: Mapping[str, Motion]) -> tuple[str, ...]:
    """Return the robots that a plan moves.

    Raises:
        MotionError: If one of them moves along a known trajectory.
    """
    robots = tuple(dict.fromkeys(target.robot for target in targets))
    for name in robots:
        if name in others:
            raise MotionError(f"{name} has a goal and a motion among others; it takes one of them")
    return robots


def _dynamic_obstacles(cell: Cell, start: Floats, others: Mapping[str, Motion]) -> CellTrajectory:
    """Return what moves along a known trajectory.

    Raises:
        MotionError: If one is no motion, or one of another robot.
    """
    if not isinstance(others, Mapping):
        raise MotionError(f"others is {shown(others)}; it takes motions by robot")
    known = CellTrajectory(cell, start)
    for name, motion in others.items():
        robot = cell.layout[name].robot
        if not isinstance(motion, Motion):
            raise MotionError(f"others[{name!r}] is {shown(motion)}; it takes a Motion")
        if name not in motion.positions or motion.layout[name].robot != robot:
            raise MotionError(f"others[{name!r}] is {motion!r}; it has no {name} that is {robot!r}")
        trajectory = JointTrajectory(
            np.arange(cell.size)[cell.slices[name]],
            motion.times,
            motion.positions[name],
            motion.velocities[name],
        )
        known = known.with_trajectory(trajectory)
        start[trajectory.columns] = motion.positions[name][0]
    return known


def _start(cell: Cell, given: Mapping[str, ArrayLike] | ArrayLike | None) -> Floats:
    """Return all joint positions at the start, (D,).

    Raises:
        MotionError: If they have another shape, or are not finite.
    """
    if given is None:
        return cell.start.copy()
    if not isinstance(given, Mapping):
        return _numbers("start", given, cell.size)
    start = cell.start.copy()
    for name, values in given.items():
        robot = cell.layout.owner(name)
        arm, own = cell.layout.arm(name).robot, cell.layout[robot].robot
        columns = [cell.slices[robot].start + own.joints.index(joint) for joint in arm.joints]
        start[columns] = _numbers(f"start of {name}", values, len(columns))
    return start


def _numbers(what: str, values: Any, count: int) -> Floats:
    return np.array(checked_numbers(what, values, count, FAR, MotionError, "rad, m"))


def _by_robot(cell: Cell, states: Floats) -> dict[str, Floats]:
    return {name: states[:, part] for name, part in cell.slices.items()}


def _all(cell: Cell, by_robot: Mapping[str, Floats]) -> Floats:
    return np.concatenate([by_robot[name] for name in cell.robots])


def _schedule(query: Query, accelerations: Floats, *, synchronised: bool) -> CellTrajectory:
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
