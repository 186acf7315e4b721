"""Distributions that a randomization draws from, and the random numbers that they turn into values.

One uniform number in (0, 1) makes one value, so how many numbers anything takes never depends on
what was drawn. The arithmetic is Python's own, and the same with every version of NumPy.
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import shake_128
from statistics import NormalDist
from typing import Any, NamedTuple

from robot_layouts.core.bounds import FAR, as_float, checked_number, checked_whole, shown
from robots import TaskError, UnknownNameError

_STANDARD = NormalDist()
_BITS = 53  # of a double


class Stream(NamedTuple):
    """Where an episode's random numbers come from: each is a function of what it is for.

    There is no state. A number follows from the episode's seed, from how many resets without a seed
    came since, and from the name of what it is drawn for: so another axis or another body never
    changes what the others draw, and the task's own streams stay what they are. The words are those
    of SHAKE-128, which are the same everywhere.

    Attributes:
        seed: Seed of the episode.
        resets: How many resets without a seed came since the one that had it.
    """

    seed: int
    resets: int = 0

    def number(self, *names: str | int) -> float:
        """Return the number in (0, 1) that belongs to a name, such as ``"mass", "cube"``."""
        return self.numbers(1, *names)[0]

    def numbers(self, count: int, *names: str | int) -> list[float]:
        """Return several; the first ones are the same however many are asked for."""
        about = "\0".join(map(str, (self.seed, self.resets, *names)))
        words = struct.unpack(f"<{count}Q", shake_128(about.encode()).digest(8 * count))
        return [((word >> (64 - _BITS)) + 0.5) * 2.0**-_BITS for word in words]


class Distribution(ABC):
    """What a number is drawn from."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """The smallest and the largest value; infinite where there is none."""

    @abstractmethod
    def value(self, u: float) -> float:
        """Return what a number in (0, 1) stands for: the inverse of the cumulative distribution."""

    @abstractmethod
    def to_json(self) -> Any:
        """Return it as plain data, which `read_distribution` turns into an equal one."""


@dataclass(frozen=True)
class Fixed(Distribution):
    """Always the same value; in files, a plain number.

    Attributes:
        number: The value.
    """

    number: float

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises:
            TaskError: If it is not finite.
        """
        _settle(self, number=_number("Fixed", "number", self.number))

    @property
    def bounds(self) -> tuple[float, float]:
        """Twice the value."""
        return self.number, self.number

    def value(self, u: float) -> float:
        """Return the value."""
        return self.number

    def to_json(self) -> Any:
        """Return the number."""
        return self.number

    def __str__(self) -> str:
        """Show the number."""
        return f"{self.number:g}"


@dataclass(frozen=True)
class _Range(Distribution, ABC):
    """Anything between two bounds."""

    low: float
    high: float

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds."""
        return self.low, self.high

    def __post_init__(self) -> None:
        name = type(self).__name__
        low, high = (_number(name, bound, getattr(self, bound)) for bound in ("low", "high"))
        if low > high:
            raise TaskError(
                f"{name}({low:g}, {high:g}) has its bounds the wrong way round; the smaller comes"
                f" first: {name}({high:g}, {low:g})"
            )
        _settle(self, low=low, high=high)

    def to_json(self) -> Any:
        """Return its name and bounds."""
        return {_NAMES[type(self)]: [self.low, self.high]}

    def __str__(self) -> str:
        """Show name and bounds."""
        return f"{_NAMES[type(self)].replace('_', ' ')} {self.low:g} … {self.high:g}"


@dataclass(frozen=True)
class Uniform(_Range):
    """Evenly between two bounds.

    Attributes:
        low: The smallest value.
        high: The largest value.
    """

    def value(self, u: float) -> float:
        """Return a value between the bounds."""
        return min(self.low + u * (self.high - self.low), self.high)


@dataclass(frozen=True)
class LogUniform(_Range):
    """Between two bounds above 0, evenly in the logarithm: for factors.

    Attributes:
        low: The smallest value, above 0.
        high: The largest value.
    """

    def __post_init__(self) -> None:
        """Refuse bounds that have no logarithm.

        Raises:
            TaskError: If they have none, or are the wrong way round.
        """
        super().__post_init__()
        if self.low <= 0:
            raise TaskError(
                f"LogUniform({self.low:g}, {self.high:g}) begins at {self.low:g}; both bounds must"
                " be above 0"
            )

    def value(self, u: float) -> float:
        """Return a value between the bounds."""
        low, high = math.log(self.low), math.log(self.high)
        return min(max(math.exp(low + u * (high - low)), self.low), self.high)


@dataclass(frozen=True)
class Whole(_Range):
    """A whole number between two bounds, both included.

    Attributes:
        low: The smallest value.
        high: The largest value.
    """

    def __post_init__(self) -> None:
        """Refuse bounds that are no whole numbers.

        Raises:
            TaskError: If they are no whole numbers, or the wrong way round.
        """
        for bound in ("low", "high"):
            value = as_whole(getattr(self, bound))
            whole = checked_whole(f"Whole: {bound}", value, -_MOST, _MOST, TaskError)
            _settle(self, **{bound: whole})
        super().__post_init__()
        _settle(self, low=int(self.low), high=int(self.high))

    def value(self, u: float) -> float:
        """Return a whole number between the bounds."""
        return min(int(self.low) + int(u * (self.high - self.low + 1)), int(self.high))


@dataclass(frozen=True)
class Normal(Distribution):
    """The normal distribution; with bounds, the part of it between them.

    Attributes:
        std: Standard deviation, without bounds.
        mean: Mean, likewise.
        low: The smallest value; None for none.
        high: The largest value; None for none.
    """

    std: float
    mean: float = 0.0
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is no normal distribution.

        Raises:
            TaskError: If a number is not finite, the deviation is negative, or there is nothing
                between the bounds.
        """
        _settle(
            self,
            std=checked_number("Normal: std", self.std, 0.0, FAR, TaskError),
            mean=_number("Normal", "mean", self.mean),
            low=None if self.low is None else _number("Normal", "low", self.low),
            high=None if self.high is None else _number("Normal", "high", self.high),
        )
        low, high = self.bounds
        if low > high:
            raise TaskError(f"Normal: low is {low:g} and high {high:g}; the smaller comes first")
        first, last = self._shares
        if last - first < _LEAST_SHARE:
            raise TaskError(
                f"{self}: there is next to nothing between these bounds; they must be nearer to"
                " the mean"
            )

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds, or infinities."""
        return (
            -math.inf if self.low is None else self.low,
            math.inf if self.high is None else self.high,
        )

    @property
    def _shares(self) -> tuple[float, float]:
        """How much of the whole distribution lies below either bound."""
        low, high = self.bounds
        if not self.std:
            return (0.0, 1.0) if low <= self.mean <= high else (0.0, 0.0)
        first, last = ((bound - self.mean) / self.std for bound in (low, high))
        return _STANDARD.cdf(first), _STANDARD.cdf(last)

    def value(self, u: float) -> float:
        """Return a value between the bounds."""
        low, high = self.bounds
        first, last = self._shares
        share = min(max(first + u * (last - first), _TAIL), 1 - _TAIL)
        return min(max(self.mean + self.std * _STANDARD.inv_cdf(share), low), high)

    def to_json(self) -> Any:
        """Return its numbers by name."""
        numbers = {"std": self.std, "mean": self.mean, "low": self.low, "high": self.high}
        return {"normal": {name: x for name, x in numbers.items() if x is not None}}

    def __str__(self) -> str:
        """Show its numbers."""
        low, high = self.bounds
        within = "" if self.low is None and self.high is None else f", {low:g} … {high:g}"
        return f"normal {self.mean:g} ± {self.std:g}{within}"


_MOST = 10**6
_LEAST_SHARE = 1e-9
_TAIL = 2.0**-54


@dataclass(frozen=True)
class Choice(Distribution):
    """One of several values, each as likely.

    Attributes:
        values: The values, at least one.
    """

    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse what cannot be chosen from.

        Raises:
            TaskError: If there is nothing, or something that is no finite number.
        """
        if isinstance(self.values, (str, bytes)) or not hasattr(self.values, "__iter__"):
            raise TaskError(f"Choice takes the values to choose from; given: {shown(self.values)}")
        values = tuple(_number("Choice", "a value", value) for value in self.values)
        if not values:
            raise TaskError("Choice has nothing to choose from; it takes one value or more")
        _settle(self, values=values)

    @property
    def bounds(self) -> tuple[float, float]:
        """The smallest and the largest value."""
        return min(self.values), max(self.values)

    def value(self, u: float) -> float:
        """Return one of the values."""
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]

    def to_json(self) -> Any:
        """Return the values."""
        return {"choice": list(self.values)}

    def __str__(self) -> str:
        """Show the values."""
        return f"one of {', '.join(f'{value:g}' for value in self.values)}"


_RANGES = {"uniform": Uniform, "log_uniform": LogUniform, "whole": Whole}
_NAMES: dict[type[Any], str] = {cls: name for name, cls in _RANGES.items()}
KINDS = (*_RANGES, "normal", "choice")


def read_distribution(data: Any, what: str) -> Distribution:
    """Return the distribution that plain data describes; a number is `Fixed`.

    Args:
        data: A distribution, a number, or such as ``{"uniform": [0.5, 2.0]}``.
        what: What is drawn from it, for messages.

    Raises:
        TaskError: If it describes none.
        UnknownNameError: If there is no such distribution.
    """
    if isinstance(data, Distribution):
        return data
    if (number := as_float(data)) is not None:
        return Fixed(number)
    if not isinstance(data, Mapping) or len(data) != 1:
        raise TaskError(
            f"{what} is {shown(data)}; a distribution is needed, such as Uniform(0.5, 2), or in a"
            " file a number or {uniform: [0.5, 2]}"
        )
    ((name, numbers),) = data.items()
    if name in _RANGES and isinstance(numbers, (list, tuple)) and len(numbers) == 2:
        return _RANGES[name](*numbers)
    if name == "choice" and isinstance(numbers, (list, tuple)):
        return Choice(tuple(numbers))
    if name == "normal" and isinstance(numbers, Mapping):
        return _read_normal(numbers, what)
    if name not in KINDS:
        raise UnknownNameError(f"distribution of {what}", name, KINDS)
    form = {"normal": "{std: 0.1, mean: 1}", "choice": "[1, 2, 3]"}.get(name, "[low, high]")
    raise TaskError(f"{what}: {name} is {shown(numbers)}; it takes {form}")


def _read_normal(numbers: Mapping[str, Any], what: str) -> Normal:
    known = ("std", "mean", "low", "high")
    for name in numbers:
        if name not in known:
            raise UnknownNameError(f"number of the normal distribution of {what}", name, known)
    if "std" not in numbers:
        raise TaskError(f"{what}: normal lacks its standard deviation, std")
    return Normal(**numbers)


def _number(name: str, what: str, value: Any) -> float:
    return checked_number(f"{name}: {what}", value, -FAR, FAR, TaskError)


def as_whole(value: Any) -> Any:
    """Return a float that is a whole number as such: files do not tell the two apart."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _settle(instance: Any, **fields: Any) -> None:
    for name, value in fields.items():
        object.__setattr__(instance, name, value)
