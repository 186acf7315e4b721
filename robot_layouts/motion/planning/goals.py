"""Where places are to go (joint positions, TCP poses, regions), and what gets them there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import FAR, checked_numbers
from robot_layouts.core.errors import MotionError, NoPlanError
from robot_layouts.kinematics import solve as inverse
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix
from robots.action_split import is_gripper
from robots.descriptor import IDENTITY, RobotDescriptor
from robots.urdf.tcp import find_tcp

if TYPE_CHECKING:
    from robot_layouts.motion.collision.cell import Cell

STARTS = 24  # places that inverse kinematics starts from, besides the posture now and keyframes
STARTS_IN_REGION = 6  # the same for each point of a region
MORE = 16  # times as many, before it is said that nothing brings a place there
POINTS = 12  # of a region that are tried
CANDIDATES = 8  # postures per place that a search may choose from
ALIKE = 0.05  # rad, m: postures nearer than that are one
BEYOND = 1e-4  # rad, m: so far beyond a limit is rounding


@dataclass(frozen=True)
class TcpGoal:
    """A pose of a place's tool centre point, in the world.

    Attributes:
        position: x, y, z (m).
        quaternion: Of the TCP link, wxyz; None if any will do.
    """

    position: Sequence[float]
    quaternion: Sequence[float] | None = None

    def __post_init__(self) -> None:
        """Refuse what is no pose."""
        object.__setattr__(self, "position", _position("position", self.position))
        object.__setattr__(self, "quaternion", _quaternion(self.quaternion))

    def __str__(self) -> str:
        """Say where."""
        turned = "" if self.quaternion is None else f", turned {_text(self.quaternion)}"
        return f"TCP at {_text(self.position)}{turned}"

    def poses(self) -> Iterator[tuple[Floats, Floats | None]]:
        """Yield the one position and quaternion."""
        turn = None if self.quaternion is None else np.array(self.quaternion)
        yield np.array(self.position), turn


@dataclass(frozen=True)
class RegionGoal:
    """Any place of a tool centre point within a box along the world's axes.

    Attributes:
        low: Its least corner, x, y, z (m).
        high: Its greatest corner, x, y, z (m).
        quaternion: Of the TCP link, wxyz; None if any will do.
    """

    low: Sequence[float]
    high: Sequence[float]
    quaternion: Sequence[float] | None = None

    def __post_init__(self) -> None:
        """Refuse what is no box."""
        object.__setattr__(self, "low", _position("low", self.low))
        object.__setattr__(self, "high", _position("high", self.high))
        object.__setattr__(self, "quaternion", _quaternion(self.quaternion))
        if not all(a <= b for a, b in zip(self.low, self.high, strict=True)):
            raise MotionError(f"a region goes from {self.low} to {self.high}; low must be lower")

    def __str__(self) -> str:
        """Say where."""
        return f"TCP from {_text(self.low)} to {_text(self.high)}"

    def poses(self) -> Iterator[tuple[Floats, Floats | None]]:
        """Yield positions in the box, the middle first, and the quaternion."""
        low, high = np.array(self.low), np.array(self.high)
        turn = None if self.quaternion is None else np.array(self.quaternion)
        yield (low + high) / 2, turn
        limits = np.stack([low, high], axis=1)
        for position in inverse.scattered(limits, POINTS - 1):
            yield position, turn


Goal = TcpGoal | RegionGoal | Sequence[float]


@dataclass(frozen=True, eq=False)
class PlaceGoal:
    """What one place is to do.

    Attributes:
        place: The robot or limb, by its full name.
        robot: The robot.
        moving: Indices of the coordinates that may move, among the cell's, (d,).
        candidates: What brings it there, best first, (n, d) (rad, m).
        goal: What was asked, in words.
        others: Returns what else brings it there, (m, d), which takes a longer search.
    """

    place: str
    robot: str
    moving: NDArray[np.intp]
    candidates: Floats
    goal: str
    others: Callable[[], Floats]


def read_targets(cell: Cell, goals: Mapping[str, Goal], start: Floats) -> tuple[PlaceGoal, ...]:
    """Return what each place is to do, in the order of the goals.

    Args:
        cell: The cell.
        goals: By place: a robot or a limb.
        start: Where all joints are, (D,) (rad, m).

    Raises:
        MotionError: If a goal is invalid, or two places share joints.
        NoPlanError: If a place cannot get there.
        UnknownNameError: If there is no such place.
    """
    if not isinstance(goals, Mapping) or not goals:
        raise MotionError("goals must name at least one place, as in {'left': TcpGoal(…)}")
    targets = tuple(_target(cell, cell.layout.arm_name(p), g, start) for p, g in goals.items())
    taken: dict[int, str] = {}
    for target in targets:
        for i in target.moving.tolist():
            if i in taken:
                raise MotionError(
                    f"goals of {taken[i]} and {target.place} move the same joints; give one of them"
                )
            taken[i] = target.place
    return targets


def arm_joints(robot: RobotDescriptor) -> tuple[str, ...]:
    """Return the joints that a plan moves: those of the arm, without grippers, heads and bases."""
    groups = {
        name: group
        for name, group in robot.action_split.groups.items()
        if not (is_gripper(name) or group.held or group.asks.drive)
    }
    named = {name: group for name, group in groups.items() if "arm" in name.split("_")}
    return tuple(joint for group in (named or groups).values() for joint in group.joints)


def _target(cell: Cell, place: str, goal: Goal, start: Floats) -> PlaceGoal:
    robot = cell.layout.owner(place)
    arm, own = cell.layout.arm(place).robot, cell.layout[robot].robot
    first = cell.slices[robot].start
    if isinstance(goal, TcpGoal | RegionGoal):
        columns = np.array([own.joints.index(joint) for joint in arm_joints(arm)], np.intp)
        postures = _Postures(cell, place, goal, start[cell.slices[robot]], columns)
        found = postures.first()
        return PlaceGoal(place, robot, columns + first, found, str(goal), postures.others)
    joints, values = _joint_goal(place, arm, goal)
    columns = np.array([own.joints.index(joint) for joint in joints], np.intp)
    _expect_within_limits(place, joints, values, cell.limits[columns + first])
    arms = np.isin(joints, arm_joints(arm))
    kept = arms | (values != start[columns + first])
    columns, values = columns[kept], values[kept]
    none = np.empty((0, len(columns)))
    return PlaceGoal(place, robot, columns + first, values[None], "joint positions", lambda: none)


def _joint_goal(
    place: str, arm: RobotDescriptor, goal: Sequence[float]
) -> tuple[tuple[str, ...], Floats]:
    try:
        values = np.asarray(goal, float)
    except (TypeError, ValueError):
        values = np.empty(0)
    for joints in (arm_joints(arm), arm.joints):
        if values.shape == (len(joints),) and np.isfinite(values).all():
            return joints, values
    own = arm_joints(arm)
    raise MotionError(
        f"the goal of {place} is {goal!r}; it takes a TcpGoal, a RegionGoal, the {len(own)} joint"
        f" positions of the arm ({', '.join(own)}), or those of all {len(arm.joints)} joints"
    )


def _expect_within_limits(
    place: str, joints: Sequence[str], values: Floats, limits: Floats
) -> None:
    excess = np.maximum(limits[:, 0] - values, values - limits[:, 1])
    worst = int(np.argmax(excess))
    if excess[worst] > BEYOND:
        low, high = limits[worst].tolist()
        raise NoPlanError(
            f"the goal of {place} puts {joints[worst]} at {values[worst]:.4g}, beyond its limits"
            f" {low:.4g} … {high:.4g}",
            "unreachable",
        )


class _Postures:
    """What brings a place's TCP to a goal.

    Inverse kinematics starts from where the place is, from keyframes and from a few random
    postures; from many more only where those lead to nothing that will do.
    """

    def __init__(
        self,
        cell: Cell,
        place: str,
        goal: TcpGoal | RegionGoal,
        start: Floats,
        columns: NDArray[np.intp],
    ) -> None:
        layout = cell.layout
        placement = layout[layout.owner(place)]
        self._place, self._goal, self._columns = place, goal, columns
        self._tree = cell.models[layout.owner(place)].kinematics
        self._back = inverse_pose(pose_matrix(placement.base_position, placement.base_quaternion))
        self._tcp = find_tcp(layout.arm(place).robot, self._tree)
        self._count = STARTS_IN_REGION if isinstance(goal, RegionGoal) else STARTS
        keyframes = list(placement.robot.keyframes.values())
        self._known = np.array([start, *keyframes], float)[:, columns]
        self._start = start
        self._nearest = np.inf, np.inf

    def first(self) -> Floats:
        """Return what is found soon, the shortest joint way first, (n, d).

        Raises:
            NoPlanError: If there is nothing, after a longer search, too.
        """
        found = self._from(np.concatenate([self._known, self._scattered(0, 1)]))
        if not len(found):
            found = self.others()
        if not len(found):
            missing, turn = self._nearest
            turned = "" if turn < 1e-2 else f" and {np.degrees(turn):.0f}° from its orientation"
            raise NoPlanError(
                f"{self._place} does not get to its goal, {self._goal}: it stays"
                f" {missing:.3g} m away{turned}",
                "unreachable",
                missing,
            )
        return found

    def others(self) -> Floats:
        """Return what a longer search finds, the shortest joint way first, (n, d)."""
        return self._from(self._scattered(1, MORE))

    def _scattered(self, first: int, last: int) -> Floats:
        """Return random starts, of the first so many times as many as are tried at first."""
        limits = self._tree.limits[self._columns]
        return inverse.scattered(limits, last * self._count)[first * self._count :]

    def _from(self, starts: Floats) -> Floats:
        """Return what the goal's poses lead to from some starts, (n, d)."""
        low, high = self._tree.limits[self._columns].T
        whole = np.tile(self._start, (len(starts), 1))
        whole[:, self._columns] = np.clip(starts, low, high)
        found: list[Floats] = []
        for position, quaternion in self._goal.poses():
            solutions = self._solve(whole, position, quaternion)
            best = int(np.argmin(solutions.missing + solutions.turn_missing))
            nearest = float(solutions.missing[best]), float(solutions.turn_missing[best])
            self._nearest = min(self._nearest, nearest)
            found += list(solutions.qpos[solutions.solved][:, self._columns])
        if not found:
            return np.empty((0, len(self._columns)))
        here = self._start[self._columns]
        unwound = self._unwound(np.array(found), here)
        order = np.argsort(np.abs(unwound - here).max(axis=1), kind="stable")
        return different(unwound[order])

    def _solve(
        self, starts: Floats, position: Floats, quaternion: Floats | None
    ) -> inverse.Solutions:
        """Return what a world pose of the TCP leads to from each start."""
        pose = self._back @ pose_matrix(position, IDENTITY if quaternion is None else quaternion)
        tcp = self._tcp
        goal = inverse.IkGoal(
            pose[:3, 3],
            tcp.links,
            None if quaternion is None else pose[:3, :3],
            tcp.turned,
            tcp.offset if tcp.offset.any() else None,
        )
        return inverse.solve(self._tree, goal, starts, self._columns.tolist())

    def _unwound(self, postures: Floats, near: Floats) -> Floats:
        """Return postures with whole turns taken off where the limits allow it, (n, d)."""
        turns = np.array([self._turns(i) for i in self._columns.tolist()])
        low, high = self._tree.limits[self._columns].T
        away = np.where(turns, 2 * np.pi * np.round((postures - near) / (2 * np.pi)), 0.0)
        shorter = postures - away
        return np.where((shorter >= low) & (shorter <= high), shorter, postures)

    def _turns(self, coordinate: int) -> bool:
        return not self._tree.slides[self._tree.drivers == coordinate].any()


def different(postures: Floats) -> Floats:
    """Return postures, (n, d), without those that are nearly as one before, and not too many."""
    kept: list[Floats] = []
    for posture in postures:
        if all(np.abs(posture - other).max() > ALIKE for other in kept):
            kept.append(posture)
    return np.array(list(islice(kept, 8 * CANDIDATES)))


def _position(what: str, values: Sequence[float]) -> tuple[float, ...]:
    return checked_numbers(what, values, 3, FAR, MotionError, "m")


def _quaternion(values: Sequence[float] | None) -> tuple[float, ...] | None:
    if values is None:
        return None
    numbers = checked_numbers("quaternion", values, 4, 2.0, MotionError)
    length = float(np.linalg.norm(numbers))
    if abs(length - 1) > 1e-3:
        raise MotionError(f"the quaternion {numbers} has length {length:.4g}; it must be 1 (wxyz)")
    return tuple(x / length for x in numbers)


def _text(values: Sequence[float]) -> str:
    return f"({', '.join(f'{x:.3g}' for x in values)})"
