"""Planning: from a layout, a start and goals to a motion that collides with nothing."""

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
from robot_layouts.motion.collision.cell import Cell, cell_of
from robot_layouts.motion.collision.clearances import Clearances
from robot_layouts.motion.model.bodies import checked_table
from robot_layouts.motion.model.obstacles import Held, Obstacle
from robot_layouts.motion.motion import Motion
from robot_layouts.motion.planning.goals import Goal, PlaceGoal, read_targets
from robot_layouts.motion.planning.query import Query
from robot_layouts.motion.planning.schedule import schedule
from robot_layouts.motion.timing.trajectories import CellTrajectory, JointTrajectory, columns_of
from robot_layouts.motion.timing.velocities import (
    Accelerations,
    largest_accelerations,
    largest_velocities,
)


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
    result = schedule(query, _all(cell, accelerations), synchronised=synchronised)
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
            columns_of(cell, [name]),
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
