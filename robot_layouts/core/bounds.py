"""Checks of numbers that users give: of the right type, finite, and of a size that makes sense."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any

from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.quoting import shown

FAR = 1e6
"""Where numbers end that mean something: positions (m), velocities (m/s, rad/s), angles (rad).

Float32, in which worlds are computed, tells places there apart by 6 cm.
"""

UNIT_TOLERANCE = 1e-3
"""How far the length of a quaternion may be from 1, wherever one is given.

Of one that is written with three digits or more it is less: ManiSkill's own (0.7071, 0, 0, 0.7072)
is 7e-5 away, those of single precision that turned often 1e-6. A slip of the pen is farther away.
"""


def checked_number(
    what: str,
    value: Any,
    low: float,
    high: float,
    error: type[RobotLayoutsError],
    unit: str = "",
) -> float:
    """Return a number between two bounds, both included, as a float.

    Args:
        what: What it is, in words.
        value: What was given; anything that ``float`` takes, but no text and no truth value.
        low: The smallest number allowed.
        high: The largest number allowed.
        error: What to raise.
        unit: Its unit; none if empty.

    Raises:
        RobotLayoutsError: ``error``, if it is not such a number.
    """
    number = as_float(value)
    if number is None or not low <= number <= high:
        within = f"from {low:g} to {high:g}" if math.isfinite(low + high) else "that is finite"
        end = f" {unit}" if unit else ""
        raise error(f"{what} is {shown(value)}; it must be a number {within}{end}")
    return number


def checked_whole(
    what: str, value: Any, low: int, high: int | None, error: type[RobotLayoutsError]
) -> int:
    """Return a whole number between two bounds, both included, as an int.

    Raises:
        RobotLayoutsError: ``error``, if it is not such a number; a truth value is not.
    """
    whole = int(value) if isinstance(value, Integral) and not _is_flag(value) else None
    if whole is None or whole < low or (high is not None and whole > high):
        within = f"of {low} or more" if high is None else f"from {low} to {high}"
        raise error(f"{what} is {shown(value)}; it must be an integer {within}")
    return whole


def checked_numbers(
    what: str,
    values: Any,
    count: int,
    largest: float,
    error: type[RobotLayoutsError],
    unit: str = "",
) -> tuple[float, ...]:
    """Return some numbers in a row, such as a position, as floats.

    Args:
        what: What they are, in words.
        values: What was given: something with an order, or an array or tensor.
        count: How many there must be.
        largest: The largest of them may be that, and the smallest its negative.
        error: What to raise.
        unit: Their unit; none if empty.

    Raises:
        RobotLayoutsError: ``error``, if they are not that.
    """
    floats = [as_float(x) for x in values] if _is_row(values) else [None]
    known = tuple(x for x in floats if x is not None)
    end = f" {unit}" if unit else ""
    if len(known) != len(floats):
        raise error(f"{what} is {shown(values)}; it takes {count} numbers{end and f' ({unit})'}")
    if len(known) != count or not all(abs(x) <= largest for x in known):
        raise error(
            f"{what} is {shown(known)}; it takes {count} finite numbers, none beyond"
            f" {largest:g}{end}"
        )
    return known


def checked_flag(what: str, value: Any, error: type[RobotLayoutsError]) -> bool:
    """Return a truth value, Python's or NumPy's.

    Raises:
        RobotLayoutsError: ``error``, if it is something else, such as a number or a text.
    """
    if not _is_flag(value):
        raise error(f"{what} is {shown(value)}; it must be True or False")
    return bool(value)


def expect_unit(what: str, quaternion: Sequence[float], error: type[RobotLayoutsError]) -> None:
    """Refuse a quaternion that is no rotation.

    Args:
        what: What it is, in words.
        quaternion: wxyz.
        error: What to raise.

    Raises:
        RobotLayoutsError: ``error``, if its length is not 1.
    """
    length = math.hypot(*quaternion)
    if not abs(length - 1) <= UNIT_TOLERANCE:
        raise error(
            f"{what} is {shown(quaternion)}, which has length {length:.6g}; a rotation has length 1"
            " (order w, x, y, z)"
        )


def checked_choice(
    what: str, value: Any, choices: tuple[str | None, ...], error: type[RobotLayoutsError]
) -> None:
    """Refuse what is none of some names.

    Raises:
        RobotLayoutsError: ``error``, if it is none of them.
    """
    if not (value is None or isinstance(value, str)) or value not in choices:
        offered = ", ".join(map(repr, choices))
        raise error(f"{what} {shown(value)} is not offered; choices: {offered}")


def as_float(value: Any) -> float | None:
    """Return a number as a float, also an array or tensor that is one; None for all else."""
    if _is_flag(value) or not (isinstance(value, Real) or getattr(value, "ndim", None) == 0):
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):  # of complex numbers, for one
        return None


def _is_flag(value: Any) -> bool:
    return type(value).__name__ in ("bool", "bool_")  # NumPy's too, which this room does not load


def _is_row(values: Any) -> bool:
    """Whether values have an order and an end, so that each has its place."""
    ordered = isinstance(values, Sequence) and not isinstance(values, (str, bytes))
    return ordered or getattr(values, "ndim", 0) == 1  # an array or a tensor
