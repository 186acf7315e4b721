"""How fast paths may be followed: limits of joints, and times along a path within them."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from layouts import Layout
from robot_layouts.core.bounds import checked_number, shown
from robot_layouts.core.errors import MissingPackageError, MotionError
from robot_layouts.core.importing import optional
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.timing.paths import Path
from robots import RobotDescriptor
from robots.action_split import JointGroup
from robots.urdf.reading import model_of

CONTROL_FREQUENCY = 20.0  # Hz; what tasks use unless they say otherwise
FASTEST = {"rad": 2.0, "m": 0.5}  # per s; of joints for which no limit is given
TO_FULL_SPEED = 0.4  # s; how long a joint takes to it, unless accelerations are given
STEP = 0.02  # s; between knots

_MARGIN = 0.995  # of a limit; what is left to rounding and to curves between the knots

Accelerations = float | Mapping[str, float | Sequence[float]]


def largest_velocities(
    layout: Layout,
    control_mode: str | Mapping[str, str] | None = None,
    factor: float = 1.0,
) -> dict[str, Floats]:
    """Return how fast each joint may move by robot, (dof,) (rad/s, m/s).

    That is the least of what its URDF says and what the control mode can ask for: where joints
    are driven relative to where they are, as in ``pd_joint_delta_pos``, as much of its bound as
    their drives follow in a control step; where velocities are asked for, theirs. Joints for which
    neither says anything move at most 2 rad/s or 0.5 m/s.

    Args:
        layout: The robots.
        control_mode: Of all robots, or by arm; None for that of the layout.
        factor: What all of it is multiplied by, over 0, at most 1.

    Raises:
        MotionError: If the factor is invalid.
        UnknownNameError: If there is no such arm or control mode.
    """
    factor = checked_number("velocity", factor, 1e-3, 1.0, MotionError)
    driven = layout.in_control_mode(layout.control_mode(control_mode))
    found: dict[str, Floats] = {}
    for name, placement in layout.items():
        robot = placement.robot
        found[name] = factor * np.minimum(_urdf_speeds(robot), _driven_speeds(driven[name].robot))
        slow = found[name] <= 0
        found[name][slow] = factor * _default_speeds(robot)[slow]
    return found


def largest_accelerations(
    layout: Layout, velocities: Mapping[str, Floats], asked: Accelerations | None = None
) -> dict[str, Floats]:
    """Return how fast each joint may accelerate by robot, (dof,) (rad/s², m/s²).

    Args:
        layout: The robots.
        velocities: Largest ones by robot; by default joints reach them in 0.4 s.
        asked: One number for all joints, or by robot, one or one for each joint; None for the
            default, also of robots that are left out.

    Raises:
        MotionError: If one is not a positive number, or there are too many or too few.
        UnknownNameError: If there is no such robot.
    """
    found = {name: speeds / TO_FULL_SPEED for name, speeds in velocities.items()}
    given = (
        asked
        if isinstance(asked, Mapping)
        else {}
        if asked is None
        else dict.fromkeys(layout, asked)
    )
    for name, numbers in given.items():
        dof = layout[name].robot.dof
        try:
            values = np.atleast_1d(np.asarray(numbers, float))
        except (TypeError, ValueError):
            values = np.zeros(1)
        right = (values > 0) & np.isfinite(values)
        if values.ndim != 1 or len(values) not in (1, dof) or not right.all():
            raise MotionError(
                f"acceleration of {name} is {shown(numbers)}; it must be a positive number"
                f" (rad/s², m/s²) or one for each of its {dof} joints"
            )
        found[name] = np.broadcast_to(values, (dof,)).copy()
    return found


def timed(path: Path, accelerations: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the fastest way along a path: times, positions and velocities of dense knots.

    It begins and ends at rest, and rests at points without a blend. Speeds are toppra's, or where
    that is not installed, those of `robot_layouts.motion.timing.velocities`.

    Args:
        path: With the largest speeds.
        accelerations: Largest ones of each coordinate, (coordinates,) (rad/s², m/s²).

    Returns:
        Times from 0, 0.02 s apart, (T,) (s); positions (T, coordinates) and velocities.

    """
    if len(path.points) < 2:  # already there
        still = np.repeat(path.points, 2, axis=0)
        return np.array([0.0, STEP]), still, np.zeros_like(still)
    parts: list[tuple[Floats, Floats, Floats]] = []
    for run in path.runs():
        at, speed = _profile(run, accelerations)
        parts.append(_knots(run, at, speed))
    times, positions, velocities = parts[0]
    for more_times, more, speeds in parts[1:]:
        times = np.concatenate([times, times[-1] + more_times[1:]])
        positions = np.concatenate([positions, more[1:]])
        velocities = np.concatenate([velocities, speeds[1:]])
    return times, positions, velocities


def _profile(run: Path, accelerations: Floats) -> tuple[Floats, Floats]:
    """Return parameters along a path without stops, and the speed at each."""
    fastest = _fastest_by_toppra
    try:
        import_toppra()
    except MissingPackageError:
        fastest = fastest_speeds
    for refined in (1, 2, 4):
        grid = run.grid(10 * refined, 0.05 / refined)
        speed = fastest(run, grid, _MARGIN * run.speeds, _MARGIN * accelerations)
        if speed is not None and np.isfinite(speed).all() and (speed[1:-1] > 0).all():
            return grid, np.asarray(speed, float)
    return _stopping(run, accelerations)


def _fastest_by_toppra(run: Path, grid: Floats, speeds: Floats, limits: Floats) -> Any:
    """Return what `fastest_speeds` does, or None if there are none."""
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    constraints = [
        JointVelocityConstraint(np.stack([-speeds, speeds], axis=1)),
        JointAccelerationConstraint(np.stack([-limits, limits], axis=1)),
    ]
    with _quiet():
        found: Any = TOPPRA(
            constraints, _geometric(run), gridpoints=grid, solver_wrapper="seidel"
        ).compute_parameterization(0.0, 0.0)
    return found[1]


def _stopping(run: Path, accelerations: Floats) -> tuple[Floats, Floats]:
    """Return a profile that keeps the limits wherever the path turns, however slowly."""
    grid = run.grid()
    slopes, bends = np.abs(run.at(grid, 1)), np.abs(run.at(grid, 2))
    with np.errstate(divide="ignore"):
        # Half of the acceleration is left to the turn, the other half to changes of speed.
        fastest = np.minimum(
            (run.speeds / slopes).min(axis=1), np.sqrt(accelerations / 2 / bends).min(axis=1)
        )
        change = (accelerations / 2 / slopes).min(axis=1).min()
    squares = _MARGIN * np.minimum(fastest, 1e3) ** 2
    squares[[0, -1]] = 0.0
    for i in range(1, len(grid)):
        squares[i] = min(squares[i], squares[i - 1] + 2 * change * (grid[i] - grid[i - 1]))
    for i in reversed(range(len(grid) - 1)):
        squares[i] = min(squares[i], squares[i + 1] + 2 * change * (grid[i + 1] - grid[i]))
    return grid, np.sqrt(squares)


def _knots(run: Path, grid: Floats, speed: Floats) -> tuple[Floats, Floats, Floats]:
    """Return knots `STEP` apart of a path followed at some speeds, which change evenly between.

    All of it is slowed down a little, so that it takes a whole number of steps.
    """
    steps = 2 * np.diff(grid) / (speed[:-1] + speed[1:])
    count = max(1, int(np.ceil(steps.sum() / STEP - 1e-9)))
    slower = count * STEP / steps.sum()
    steps, speed = slower * steps, speed / slower
    clock = np.concatenate([[0.0], np.cumsum(steps)])
    change = np.diff(speed) / steps
    times = np.arange(count + 1.0) * STEP
    i = np.clip(np.searchsorted(clock, times, side="right") - 1, 0, len(steps) - 1)
    since = np.minimum(times, clock[-1]) - clock[i]
    at = np.clip(grid[i] + since * (speed[i] + change[i] * since / 2), 0.0, run.length)
    rate = np.maximum(speed[i] + change[i] * since, 0.0)
    rate[[0, -1]], at[[0, -1]] = 0.0, (0.0, run.length)
    positions = run.at(at)
    positions[[0, -1]] = run.points[[0, -1]]
    return times, positions, run.at(at, 1) * rate[:, None]


def _driven_speeds(robot: RobotDescriptor) -> Floats:
    """Return what the control mode can ask of each joint, (dof,); infinite if it does not limit."""
    return np.array(
        [speed for group in robot.action_split.groups.values() for speed in _group_speeds(group)]
    )


def _group_speeds(group: JointGroup) -> list[float]:
    count = len(group.joints)
    reaches = [min(abs(low), abs(high)) for low, high in group.ranges]
    if group.held or group.asks.tcp or group.asks.drive:
        return [np.inf] * count
    if group.command == "position":
        if not group.delta:
            return [np.inf] * count
        reaches = reaches * count if group.mimic else reaches
        shares = [1.0] * count if group.target else _followed_shares(group)
        ways = zip(shares, reaches[:count], strict=True)
        return [share * reach * CONTROL_FREQUENCY for share, reach in ways]
    return reaches[-count:]


def _followed_shares(group: JointGroup) -> list[float]:
    """Return the share of the way to its target that each joint's drive goes in a control step."""
    frequency = CONTROL_FREQUENCY
    return [1 - math.exp(-k / (d * frequency)) if d else 1.0 for k, d, _ in group.drives]


def _urdf_speeds(robot: RobotDescriptor) -> Floats:
    moving = model_of(robot.urdf.locate()).moving
    known = {joint.name: joint.velocity for joint in moving if (joint.velocity or 0) > 0}
    defaults = _default_speeds(robot)
    return np.array([known.get(j, defaults[i]) for i, j in enumerate(robot.joints)], float)


def _default_speeds(robot: RobotDescriptor) -> Floats:
    groups = robot.action_split.groups.values()
    return np.array([FASTEST[group.unit] for group in groups for _ in group.joints])


def import_toppra() -> None:
    """Import toppra.

    Raises:
        MissingPackageError: If it is not installed.
    """
    with _quiet():
        optional("toppra", "timing a motion needs toppra", "motion")


@contextmanager
def _quiet() -> Generator[None]:
    """Keep toppra from logging; its handlers write to stderr."""
    log = logging.getLogger("toppra")
    before = log.disabled
    log.disabled = True
    try:
        yield
    finally:
        log.disabled = before


def _geometric(path: Path) -> Any:
    """Return a path as toppra takes one."""
    from toppra.interpolator import AbstractGeometricPath

    class Geometric(AbstractGeometricPath):
        def __call__(self, path_positions: Any, order: int = 0) -> Floats:
            at = path.at(np.atleast_1d(path_positions), order)
            return at if np.ndim(path_positions) else at[0]

        @property
        def dof(self) -> int:
            return path.points.shape[1]

        @property
        def path_interval(self) -> Floats:
            return np.array([0.0, path.length])

        @property
        def waypoints(self) -> None:
            return None

    return Geometric()


_FLAT = 1e-9  # slopes of coordinates that hardly move (s, as paths are measured)
_FAST = 1e6  # squared speed that no limit bounds


class _Lines(NamedTuple):
    """Bounds of u at each point: at most ``a - b x``, at least ``-a - b x``, and x at most."""

    a: Floats
    b: Floats
    fastest: Floats


def fastest_speeds(path: Path, grid: Floats, speeds: Floats, accelerations: Floats) -> Floats:
    """Return the largest speed of the parameter at each point, from rest to rest, (m,).

    As toppra does, for where it is not. TOPP-RA (Pham and Pham, 2018) keeps of each point of the
    path the squared speeds from which its end can still be reached, from the end to the start, and
    then goes as fast as these allow. In squares of the speed x and accelerations u of the
    parameter, all limits are lines: A - B x at most, or C - D x at least, for u. At rest nothing is
    asked for, so that all begin at x = 0.

    Args:
        path: Without stops.
        grid: Parameters, (m,).
        speeds: Largest of each coordinate, (coordinates,) (rad/s, m/s).
        accelerations: Likewise (rad/s², m/s²).
    """
    steps = np.diff(grid)
    lines = _limits(steps, path.at(grid, 1), path.at(grid, 2), speeds, accelerations)
    reachable = np.zeros(len(grid))
    for i in reversed(range(len(steps))):
        reachable[i] = _largest(lines, i, steps[i], reachable[i + 1])
    squares = np.zeros(len(grid))
    for i, step in enumerate(steps):
        most = (lines.a[i] - lines.b[i] * squares[i]).min(initial=_FAST)
        squares[i + 1] = np.clip(squares[i] + 2 * step * most, 0.0, reachable[i + 1])
    return np.sqrt(squares)


def _limits(
    steps: Floats, slopes: Floats, bends: Floats, speeds: Floats, accelerations: Floats
) -> _Lines:
    """Return the limits of each step: of accelerations where it begins, and where it ends."""
    # Where it ends, x is x + 2 step u, which adds to what multiplies u.
    behind = slopes[1:] + 2 * steps[:, None] * bends[1:]
    moved = np.concatenate([slopes[:-1], behind], axis=1)
    turned = np.concatenate([bends[:-1], bends[1:]], axis=1)
    limit = np.tile(accelerations, 2)
    flat = np.abs(moved) < _FLAT
    scale = np.where(flat, 1.0, moved)
    with np.errstate(divide="ignore"):
        by_turning = np.where(flat & (turned != 0), limit / np.abs(turned), np.inf).min(axis=1)
        by_speed = (speeds / np.abs(slopes[:-1])).min(axis=1) ** 2
    return _Lines(
        np.where(flat, _FAST, limit / np.abs(scale)),
        np.where(flat, 0.0, turned / scale),
        np.minimum(np.minimum(by_turning, by_speed), _FAST),
    )


def _largest(lines: _Lines, i: int, step: float, behind: float) -> float:
    """Return the largest x of a point from which some u leads to between 0 and ``behind``."""
    onward = 1 / (2 * step)
    above = np.append(lines.a[i], behind * onward), np.append(lines.b[i], onward)
    below = np.append(-lines.a[i], 0.0), np.append(lines.b[i], onward)
    room = above[0][:, None] - below[0]
    faster = above[1][:, None] - below[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(faster > 0, room / faster, np.inf)
    return float(min(ends.min(), lines.fastest[i]))
