"""What a number that is drawn may be, and numbers that belong together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from typing import Annotated, Any, TypeAlias, get_origin, get_type_hints

from robot_layouts.core.bounds import shown
from robots import TaskError, UnknownNameError
from tasks.randomization.distributions import (
    Distribution,
    Fixed,
    LogUniform,
    Whole,
    read_distribution,
)

Declared = Distribution | float | Mapping[str, Any] | None
"""What a field of a `Group` takes: a distribution, a number, or plain data that describes one."""


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
            TaskError: If it is not a distribution, or may draw invalid values.
        """
        drawn = read_distribution(data, what)
        if self.whole and isinstance(drawn, Fixed) and drawn.number.is_integer():
            drawn = Whole(int(drawn.number), int(drawn.number))
        if self.whole and not isinstance(drawn, Whole):
            raise TaskError(f"{what} is drawn from {drawn}; it takes Whole(low, high)")
        lowest, highest = drawn.bounds
        if lowest < self.low or highest > self.high:
            raise TaskError(
                f"{what} {_reach(drawn)}; it must stay within"
                f" {self.low:g} … {self.high:g} ({self.unit}){_remedy(drawn)}"
            )
        return drawn


Metres: TypeAlias = Annotated[Declared, Limits(-math.inf, math.inf, "m")]
Angle: TypeAlias = Annotated[Declared, Limits(-math.inf, math.inf, "rad")]
Fraction: TypeAlias = Annotated[Declared, Limits(0.0, 1.0, "a fraction")]

COLORS = ("red", "green", "blue")
TONES = LogUniform(0.02, 1.0)
"""Of light: dark, middle and bright tones about as often, as eyes see them."""


def _reach(drawn: Distribution) -> str:
    """Say what a distribution may draw."""
    lowest, highest = drawn.bounds
    if isinstance(drawn, Fixed):
        return f"is {lowest:g}"
    return f"may be {lowest:g} … {highest:g}, drawn from {drawn}"


def _remedy(drawn: Distribution) -> str:
    unbounded = any(math.isinf(bound) for bound in drawn.bounds)
    return ": give it bounds, Normal(std, mean, low, high)" if unbounded else ""


class Group:
    """Several numbers that belong together; a frozen dataclass of distributions.

    Fields that are annotated with `Limits` are drawn, unless they are None.
    """

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If a field is not a distribution, or may draw invalid values.
        """
        for name in self.needed():
            if getattr(self, name) is None:
                raise TaskError(f"{type(self).__name__}: {name} is None; it must be declared")
        for name, given in self.declared.items():
            what = f"{type(self).__name__}: {name}"
            object.__setattr__(self, name, _limits(type(self))[name].read(given, what))

    @property
    def declared(self) -> dict[str, Distribution]:
        """The distributions of those that are varied, by field."""
        given = {name: getattr(self, name) for name in _limits(type(self))}
        return {name: value for name, value in given.items() if value is not None}

    @classmethod
    def read(cls, data: Any, what: str) -> Group:
        """Return the group that was given, or that plain data describes.

        Raises:
            TaskError: If it is not such a group, or lacks a number that it needs.
            UnknownNameError: If it has no such field.
        """
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            raise TaskError(f"{what} is {shown(data)}; it takes a {cls.__name__}")
        for name in data:
            if name not in cls.names():
                raise UnknownNameError(f"number of {what}", name, cls.names())
        for name in cls.needed():
            if name not in data:
                raise TaskError(f"{what} lacks {name}; it takes a {cls.__name__}")
        return cls(**data)

    @classmethod
    def needed(cls) -> tuple[str, ...]:
        """Return the names of what must be declared."""
        declared = fields(cls)  # pyright: ignore[reportArgumentType]
        return tuple(field.name for field in declared if field.default is MISSING)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of what can be declared."""
        return tuple(field.name for field in fields(cls))  # pyright: ignore[reportArgumentType]

    @property
    def drawn(self) -> Mapping[str, Distribution | Group]:
        """What is drawn for each thing, by name."""
        return self.declared

    def to_json(self) -> Any:
        """Return it as plain data, which `read` turns into an equal one."""
        return {name: drawn.to_json() for name, drawn in self.declared.items()}

    def __str__(self) -> str:
        """Show what is varied."""
        return ", ".join(f"{name} {drawn}" for name, drawn in self.declared.items())


@cache
def _limits(group: type[Group]) -> dict[str, Limits]:
    """Return what each number of a group may be, by field."""
    hints = get_type_hints(group, include_extras=True).items()
    return {name: hint.__metadata__[0] for name, hint in hints if get_origin(hint) is Annotated}


def some_of(
    what: str, given: Sequence[str] | str, choices: Sequence[str], kind: str
) -> tuple[str, ...]:
    """Return names that were chosen, or the only one.

    Args:
        what: The field that they are given for, for messages.
        given: What was given.
        choices: All names that there are.
        kind: What one of them is called.

    Raises:
        TaskError: If nothing is chosen.
        UnknownNameError: If there is no such name.
    """
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, Sequence) or not names:
        raise TaskError(f"{what} is {shown(given)}; it takes some of {', '.join(choices)}")
    for name in names:
        if name not in choices:
            raise UnknownNameError(kind, name, choices)
    return tuple(names)
