"""What can be varied: which numbers each axis takes, in which unit, and for what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf, pi
from typing import Any, ClassVar

from robots import TaskError, UnknownNameError
from robots.common.bounds import shown
from tasks.varying.distributions import Distribution, Fixed, Whole, read_distribution


@dataclass(frozen=True)
class Limits:
    """What may be drawn.

    Attributes:
        low: The smallest number that makes sense.
        high: The largest.
        unit: In words, for messages and tables.
        whole: Whether it must be a whole number.
    """

    low: float
    high: float
    unit: str
    whole: bool = False

    def read(self, data: Any, what: str) -> Distribution:
        """Return the distribution that was given, if all that it may draw is within.

        Raises:
            TaskError: If it is none, or may draw what makes no sense.
        """
        drawn = read_distribution(data, what)
        if self.whole and isinstance(drawn, Fixed) and drawn.number.is_integer():
            drawn = Whole(int(drawn.number), int(drawn.number))
        if self.whole and not isinstance(drawn, Whole):
            raise TaskError(f"{what} is drawn from {drawn}; it takes Whole(low, high)")
        lowest, highest = drawn.bounds
        if lowest < self.low or highest > self.high:
            ends = [f"{self.low:g}", f"{self.high:g}"]
            raise TaskError(
                f"{what} may be {lowest:g} … {highest:g}, drawn from {drawn}; it must stay within"
                f" {' … '.join(ends)} ({self.unit})"
            )
        return drawn


class Group:
    """Several numbers that belong together; a frozen dataclass of distributions.

    Attributes:
        limits: What each of them may be, by field; a field that is None is not varied.
    """

    limits: ClassVar[Mapping[str, Limits]] = {}

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If a field is no distribution, or may draw what makes no sense.
        """
        for name, given in self.declared.items():
            what = f"{type(self).__name__}: {name}"
            object.__setattr__(self, name, self.limits[name].read(given, what))

    @property
    def declared(self) -> dict[str, Distribution]:
        """The distributions of those that are varied, by field."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]
        return {name: value for name, value in given.items() if value is not None}

    @classmethod
    def read(cls, data: Any, what: str) -> Group:
        """Return the group that was given, or that plain data describes.

        Raises:
            TaskError: If it is none.
            UnknownNameError: If it has no such field.
        """
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            raise TaskError(f"{what} is {shown(data)}; it takes a {cls.__name__}")
        for name in data:
            if name not in cls.limits:
                raise UnknownNameError(f"number of {what}", name, cls.limits)
        return cls(**data)

    def to_json(self) -> Any:
        """Return it as plain data, which `read` turns into an equal one."""
        return {name: drawn.to_json() for name, drawn in self.declared.items()}

    def __str__(self) -> str:
        """Show what is varied."""
        return ", ".join(f"{name} {drawn}" for name, drawn in self.declared.items())


@dataclass(frozen=True)
class Axis:
    """One way in which worlds vary.

    Attributes:
        takes: What is drawn: a number within limits, or a group of numbers.
        named: Whether it is declared for each of several things, by name.
        rebuilds: Whether a world must be built anew to change it.
    """

    takes: Limits | type[Group]
    named: bool = True
    rebuilds: bool = False

    def read(self, data: Any, what: str) -> Any:
        """Return what was declared for an axis, checked: one thing, or by name.

        Raises:
            TaskError: If it makes no sense.
        """
        if not self.named:
            return None if data is None else self.takes.read(data, what)
        if not isinstance(data, Mapping):
            raise TaskError(
                f"{what} is {shown(data)}; it takes what is drawn by name, such as"
                f" {what}={{'cube': Uniform(0.5, 2)}}"
            )
        for name in data:
            if not isinstance(name, str) or not name:
                raise TaskError(f"{what} has the name {shown(name)}; names are texts")
        return {name: self.takes.read(given, f"{what} of {name!r}") for name, given in data.items()}


@dataclass(frozen=True, kw_only=True)
class Shift(Group):
    """How a robot's base is off its placement, in the world or in what it hangs on.

    Attributes:
        x: Along x (m).
        y: Along y (m).
        z: Along z (m).
        yaw: Turn about z, at its own place (rad).
    """

    x: Distribution | None = None
    y: Distribution | None = None
    z: Distribution | None = None
    yaw: Distribution | None = None

    limits: ClassVar[Mapping[str, Limits]] = {
        **dict.fromkeys(("x", "y", "z"), Limits(-100.0, 100.0, "m")),
        "yaw": Limits(-2 * pi, 2 * pi, "rad"),
    }


_FACTOR = Limits(1e-3, 1e3, "factor on what is declared")
_COEFFICIENT = Limits(0.0, 1e3, "coefficient of friction")
_STEPS = Limits(0, 1000, "control steps", whole=True)
_NOISE = Limits(-inf, inf, "added to the number")

AXES = {
    "mass": Axis(_FACTOR),
    "friction": Axis(_COEFFICIENT),
    "size": Axis(Limits(0.01, 100.0, "factor on what is declared"), rebuilds=True),
    "stiffness": Axis(_FACTOR),
    "damping": Axis(_FACTOR),
    "joint_friction": Axis(_COEFFICIENT),
    "gravity": Axis(Limits(0.0, 1000.0, "m/s²"), named=False, rebuilds=True),
    "bases": Axis(Shift),
    "action_noise": Axis(_NOISE),
    "action_delay": Axis(_STEPS, named=False),
    "sensor_noise": Axis(_NOISE),
    "observation_delay": Axis(_STEPS, named=False),
}
"""Every axis by its field in `tasks.Randomization`, in the order in which they are shown."""
