"""Motions as data: where the joints of all robots of a layout are at every moment.

The curves through their knots are cubic, and still beyond the ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from layouts import Layout
from robot_layouts.core.bounds import FAR, shown
from robot_layouts.core.errors import MotionError, UnknownNameError
from robot_layouts.kinematics.rotations import Floats

STILL: Mapping[str, Floats] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """Joint positions of all robots of a layout over time.

    Between the knots the positions follow cubic curves (Hermite's), which have the positions and
    velocities of the knots; before the first knot and after the last everything stands still. All
    arrays are read-only.

    Attributes:
        layout: The robots, and where they stand.
        times: Of the knots, from 0, increasing, (T,) with T of 2 or more (s).
        positions: Joint positions there by robot, in its descriptor's order, (T, dof) (rad, m).
        velocities: Joint velocities there by robot, (T, dof) (rad/s, m/s).
        obstacles: What the robots were kept clear of, besides each other.
        held: Bodies that they carry.
        table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m).
        clearance: How far the robots were asked to stay from everything (m).
        largest_velocities: What the joints may do by robot, (dof,) (rad/s, m/s); robots that are
            left out may do what their URDFs allow.
        largest_accelerations: The same for accelerations, (dof,) (rad/s², m/s²); those of robots
            that are left out are not limited.

    Raises:
        MotionError: If the arrays do not fit the layout or each other, or hold what is no number,
            or one beyond a million.
    """

    layout: Layout
    times: Floats
    positions: Mapping[str, Floats]
    velocities: Mapping[str, Floats]
    obstacles: tuple[Any, ...] = ()
    held: tuple[Any, ...] = ()
    table: tuple[float, float, float, float] | None = None
    clearance: float = 0.0
    largest_velocities: Mapping[str, Floats] = field(default_factory=lambda: STILL)
    largest_accelerations: Mapping[str, Floats] = field(default_factory=lambda: STILL)

    def __post_init__(self) -> None:
        """Freeze the arrays and refuse those that do not fit."""
        times = _frozen(self.times)
        _expect_times(times)
        object.__setattr__(self, "times", times)
        for what in ("positions", "velocities"):
            object.__setattr__(self, what, self._by_robot(what, (len(times),)))
        for what in ("largest_velocities", "largest_accelerations"):
            object.__setattr__(self, what, self._by_robot(what, (), some=True))
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "held", tuple(self.held))

    def __repr__(self) -> str:
        """Show the robots and how long it takes; the numbers are many."""
        robots = ", ".join(f"{name}={place.robot.name}" for name, place in self.layout.items())
        return f"Motion({robots}: {self.duration:.2f} s, {len(self.times)} knots)"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the fields; read-only mappings do not pickle by themselves."""
        fields = dict(self.__dict__)
        for name, value in fields.items():
            if isinstance(value, MappingProxyType):
                fields[name] = dict(value)
        return (_rebuild, (type(self), fields))

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return float(self.times[-1])

    @property
    def moving(self) -> tuple[str, ...]:
        """The robots that do not stand still all the time, in the layout's order."""
        return tuple(
            name
            for name, qpos in self.positions.items()
            if self.velocities[name].any() or (qpos != qpos[0]).any()
        )

    def sample(self, times: ArrayLike) -> dict[str, Floats]:
        """Return joint positions by robot at some times (rad, m).

        Args:
            times: (…) (s); one number gives (dof,), n of them give (n, dof).

        Raises:
            MotionError: If they are no finite numbers.
        """
        times = _moments(times)
        return {
            name: hermite(self.times, qpos, self.velocities[name], times)
            for name, qpos in self.positions.items()
        }

    def velocity(self, times: ArrayLike) -> dict[str, Floats]:
        """Return joint velocities by robot at some times, shaped as in `sample` (rad/s, m/s)."""
        times = _moments(times)
        return {
            name: hermite_slopes(self.times, qpos, self.velocities[name], times)
            for name, qpos in self.positions.items()
        }

    @property
    def start(self) -> dict[str, Floats]:
        """Joint positions at the beginning by robot, (dof,) (rad, m)."""
        return {name: qpos[0] for name, qpos in self.positions.items()}

    @property
    def end(self) -> dict[str, Floats]:
        """Joint positions at the end by robot, (dof,) (rad, m)."""
        return {name: qpos[-1] for name, qpos in self.positions.items()}

    def _by_robot(self, what: str, rows: tuple[int, ...], *, some: bool = False) -> Any:
        given = getattr(self, what)
        if not isinstance(given, Mapping):
            raise MotionError(f"{what} is a {type(given).__name__}; it takes a mapping by robot")
        for name in given:
            if name not in self.layout:
                raise UnknownNameError("robot of this motion", name, self.layout)
        missing = [name for name in self.layout if name not in given]
        if missing and not some:
            raise MotionError(f"{what} lacks {', '.join(missing)}; all robots have some")
        arrays = {name: _frozen(given[name]) for name in self.layout if name in given}
        for name, array in arrays.items():
            shape = (*rows, self.layout[name].robot.dof)
            if array.shape != shape:
                raise MotionError(
                    f"{what} of {name} has the shape {array.shape}; it must be {shape}"
                )
            if some and not (array > 0).all():
                raise MotionError(f"{what} of {name} are {shown(array.tolist())}; they must be > 0")
            if not some and not (np.abs(array) <= FAR).all():
                raise MotionError(
                    f"{what} of {name} holds {_worst(array)}; they must be finite, {FAR:g} at most"
                )
        return MappingProxyType(arrays)


def _expect_times(times: Floats) -> None:
    if times.ndim != 1 or len(times) < 2:
        raise MotionError(f"times has the shape {times.shape}; it must be (T,), T of 2 or more")
    if not (times <= FAR).all() or times[0] != 0.0 or (np.diff(times) <= 0).any():
        raise MotionError(f"times must begin with 0, increase, and be finite, {FAR:g} s at most")


def _worst(array: Floats) -> str:
    """Return the number farthest from 0, or one that is not finite, as text."""
    return f"{array.flat[np.argmax(np.nan_to_num(np.abs(array), nan=np.inf))]:g}"


def _frozen(array: ArrayLike | Sequence[float]) -> Floats:
    try:
        own = np.array(array, float)
    except (TypeError, ValueError) as error:
        raise MotionError(f"an array of numbers is needed: {error}") from None
    own.setflags(write=False)
    return own


def _rebuild(kind: type[TimedMotion], fields: dict[str, Any]) -> TimedMotion:
    return kind(**fields)


def _moments(times: ArrayLike) -> Floats:
    try:
        moments = np.asarray(times, float)
    except (TypeError, ValueError):
        moments = np.array(np.nan)
    if not np.isfinite(moments).all():
        raise MotionError(f"times are {shown(times)}; they must be finite numbers (s)")
    return moments


def hermite(knots: Floats, values: Floats, slopes: Floats, times: ArrayLike) -> Floats:
    """Return values of the cubic curves through knots at some times, (…, n).

    Args:
        knots: Times of the knots, increasing, (T,) (s).
        values: There, (T, n).
        slopes: Derivatives there, (T, n) (per s).
        times: (…) (s); beyond the ends the values are those of the ends.
    """
    at, i, step = _places(knots, times)
    s = ((at - knots[i]) / step)[..., None]
    start, end = values[i], values[i + 1]
    leave, arrive = slopes[i] * step[..., None], slopes[i + 1] * step[..., None]
    rise = end - start
    # Horner's form around the start: exact at both ends for values that stay equal.
    bend = 3.0 * rise - 2.0 * leave - arrive
    twist = leave + arrive - 2.0 * rise
    return np.where(s < 1.0, start + s * (leave + s * (bend + s * twist)), end)


def hermite_slopes(knots: Floats, values: Floats, slopes: Floats, times: ArrayLike) -> Floats:
    """Return derivatives of the same curves, (…, n) (per s); 0 beyond the ends."""
    at, i, step = _places(knots, times)
    s = ((at - knots[i]) / step)[..., None]
    leave, arrive = slopes[i], slopes[i + 1]
    rise = (values[i + 1] - values[i]) / step[..., None]
    bend = 2.0 * (3.0 * rise - 2.0 * leave - arrive)
    twist = 3.0 * (leave + arrive - 2.0 * rise)
    inside = (np.asarray(times) >= knots[0]) & (np.asarray(times) <= knots[-1])
    within = np.where(s < 1.0, leave + s * (bend + s * twist), arrive)
    return np.where(inside[..., None], within, 0.0)


def hermite_extremes(knots: Floats, values: Floats, slopes: Floats) -> tuple[Floats, ...]:
    """Return where the same curves go farthest, and where they are fastest.

    Returns:
        Times (s), values there and derivatives there (per s), each (k, n): of all knots, and
        within each piece of every point at which a curve turns back or its slope does.
    """
    step = np.diff(knots)[:, None]
    rise, leave, arrive = np.diff(values, axis=0), slopes[:-1] * step, slopes[1:] * step
    bend, twist = 3.0 * rise - 2.0 * leave - arrive, leave + arrive - 2.0 * rise
    root = np.sqrt(np.maximum(bend * bend - 3.0 * twist * leave, 0.0))
    sum_ = -(bend + np.copysign(root, bend))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shares = np.stack([sum_ / (3.0 * twist), leave / sum_, -bend / (3.0 * twist)])
        s = np.clip(np.nan_to_num(shares, nan=0.0), 0.0, 1.0)
        inner = (leave + s * (2.0 * bend + 3.0 * s * twist)) / step
    found = (knots[:-1, None] + s * step, values[:-1] + s * (leave + s * (bend + s * twist)), inner)
    ends = (np.broadcast_to(knots[:, None], values.shape), values, slopes)
    return tuple(
        np.concatenate([at, more.reshape(-1, values.shape[1])])
        for at, more in zip(ends, found, strict=True)
    )


def _places(knots: Floats, times: ArrayLike) -> tuple[Floats, np.ndarray, Floats]:
    """Return times within the knots, the piece that each lies in, and how long that is (s)."""
    at = np.clip(np.asarray(times, float), knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    return at, i, knots[i + 1] - knots[i]
