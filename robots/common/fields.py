"""Checks values against the types that their fields are declared with: of declarations, of json."""

from __future__ import annotations

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from robots.common.errors import RobotLayoutsError

LARGEST = 3.4028234663852886e38  # of single precision, in which the simulator computes
UNIT_TOLERANCE = 1e-6  # rounding of a quaternion written with seven digits
_SHOWN = 60  # characters of a value in a message

_NUMBERS = {
    bool: "True or False",
    int: "a whole number",
    float: "a finite number (below 3.4e38)",
    str: "a text (not empty, in Unicode)",
}


def show(value: Any) -> str:
    """Return a value for a message: as it is written, cut short, or its type if that fails."""
    try:
        text = repr(value)
    except Exception as error:  # whatever a class of the user's own does
        text = f"of type {type(value).__name__} ({type(error).__name__} when shown)"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


@dataclass(frozen=True)
class Within:
    """Bounds of a number, both included: ``Annotated[float, Within(0.0, 1.0)]``.

    Attributes:
        low: The smallest number allowed.
        high: The largest number allowed.
        unit: Their unit; none if empty.
        kind: What the number is called.
    """

    low: float
    high: float
    unit: str = ""
    kind: str = "number"

    def accepts(self, value: Any) -> bool:
        """Return whether a number is within."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        """Say what the number must be."""
        return f"a {self.kind} from {self.low:g} to {self.high:g}{self.unit and f' {self.unit}'}"


@dataclass(frozen=True)
class OfLengthOne:
    """What a quaternion is if it is a rotation: ``Annotated[Quaternion, OfLengthOne()]``."""

    def accepts(self, value: Any) -> bool:
        """Return whether numbers have length 1, to within rounding."""
        return abs(math.hypot(*value) - 1) <= 1e-3

    def __str__(self) -> str:
        """Say what the numbers must be."""
        return "a rotation, of length 1 (order w, x, y, z)"


class _Wrong(Exception):
    """A value is not what its field takes; the message says what it would take."""


def settle(value: Any, hint: Any, name: str, error: type[RobotLayoutsError]) -> Any:
    """Return a value as an annotation has it.

    Lists become tuples where tuples are declared, and numbers of other libraries become Python's.

    Args:
        value: Whatever was given.
        hint: ``bool``, ``int``, ``float``, ``str``, a class, a union, a tuple, a list, a sequence,
            a mapping from names, a ``Literal``, a ``TypedDict``, or one of these ``Annotated`` with
            `Within` or `OfLengthOne`. Numbers must be finite and fit in single
            precision; texts must not be empty, and
            such that UTF-8 can hold them.
        name: What messages call it.
        error: What to raise.

    Raises:
        RobotLayoutsError: ``error``, if it is no such thing.
    """
    try:
        return _settle(value, hint, name)
    except _Wrong as wrong:
        raise error(str(wrong)) from None


def settle_fields(instance: Any, error: type[RobotLayoutsError], owner: str | None = None) -> None:
    """Check every field of a frozen dataclass against its annotation; only for `__post_init__`.

    Args:
        instance: The dataclass that is being made.
        error: What to raise.
        owner: What messages call it; its class, if not given.

    Raises:
        RobotLayoutsError: ``error``, if a field is no such thing.
    """
    owner, hints = owner or type(instance).__name__, _hints(type(instance))
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        settled = settle(value, hints[field.name], f"{owner}: {field.name}", error)
        if settled is not value:
            object.__setattr__(instance, field.name, settled)


def expect_unit(
    what: str, quaternion: tuple[float, float, float, float], error: type[RobotLayoutsError]
) -> None:
    """Refuse a quaternion that is no rotation.

    Args:
        what: Whose it is, for the message.
        quaternion: wxyz.
        error: What to raise.

    Raises:
        RobotLayoutsError: ``error``, if its length is not 1.
    """
    length = math.hypot(*quaternion)
    if abs(length - 1) > UNIT_TOLERANCE:
        raise error(
            f"{what}: quaternion {quaternion} has length {length:.6g}; a rotation has length 1"
            " (order w, x, y, z)"
        )


def _settle(value: Any, hint: Any, name: str) -> Any:
    if hasattr(value, "tolist") and not isinstance(value, type):
        value = value.tolist()  # an array or number of numpy or torch
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return _settle_annotated(value, arguments, name)
    if origin is typing.Literal:
        return _settle_literal(value, arguments, name)
    if origin in (typing.Union, types.UnionType):
        return _settle_union(value, arguments, name)
    if origin in (tuple, list, Sequence):
        return _settle_sequence(value, origin, arguments, name)
    if origin in (Mapping, dict):
        return {
            _settle_plain(key, str, f"a name in {name}"): _settle(
                inner, arguments[1], f"{name}[{show(key)}]"
            )
            for key, inner in _mapping(value, name).items()
        }
    if typing.is_typeddict(hint):
        return _settle_typed_dict(value, hint, name)
    return _settle_plain(value, hint, name)


def _settle_annotated(value: Any, arguments: Sequence[Any], name: str) -> Any:
    plain, bound = arguments
    try:
        settled = _settle(value, plain, name)
    except _Wrong:
        if plain not in (int, float):
            raise  # which of several is wrong
        raise _Wrong(f"{name} is {show(value)}; it must be {bound}") from None
    if not bound.accepts(settled):
        raise _Wrong(f"{name} is {show(value)}; it must be {bound}")
    return settled


def _settle_literal(value: Any, choices: Sequence[Any], name: str) -> Any:
    if not any(type(value) is type(choice) and value == choice for choice in choices):
        raise _Wrong(f"{name} is {show(value)}; it must be {' or '.join(map(repr, choices))}")
    return value


def _settle_plain(value: Any, hint: Any, name: str) -> Any:
    if hint is Any:
        return value
    if hint is str:
        ok = isinstance(value, str) and bool(value.strip()) and _can_be_written(value)
    elif hint in (int, float):
        kinds = int if hint is int else (int, float)
        ok = isinstance(value, kinds) and not isinstance(value, bool) and abs(value) <= LARGEST
    else:
        ok = isinstance(value, hint)
    if not ok:
        raise _wrong(value, hint, name)
    return value


def _settle_union(value: Any, hints: Sequence[Any], name: str) -> Any:
    several = isinstance(value, (list, tuple))
    fitting = [hint for hint in hints if (typing.get_origin(hint) is tuple) == several]
    for hint in fitting if several else hints:
        try:
            return _settle(value, hint, name)
        except _Wrong:
            if several:
                raise  # which of the numbers is wrong
    raise _Wrong(f"{name} is {show(value)}; it must be {' or '.join(map(_describe, hints))}")


def _settle_sequence(value: Any, origin: Any, hints: Sequence[Any], name: str) -> Any:
    if not isinstance(value, (list, tuple)):
        raise _Wrong(f"{name} is {show(value)}; it must be {_describe_sequence(hints)}")
    each = [hints[0]] * len(value) if len(hints) == 1 or hints[1:] == (...,) else hints
    if len(value) != len(each):
        raise _Wrong(f"{name} has {len(value)} entries; it must be {_describe_sequence(hints)}")
    settled = [
        _settle(inner, hint, f"{name}[{index}]")
        for index, (inner, hint) in enumerate(zip(value, each, strict=True))
    ]
    if origin is list:
        return settled
    same = isinstance(value, tuple) and all(map(_is, settled, value))
    return value if same else tuple(settled)


def _settle_typed_dict(value: Any, hint: Any, name: str) -> dict[str, Any]:
    hints, given = _hints(hint), _mapping(value, name)
    missing = sorted(hint.__required_keys__ - given.keys())
    if missing:
        raise _Wrong(f"{name} has no {show(missing[0])}")
    unknown = [key for key in given if key not in hints]
    if unknown:
        raise _Wrong(f"{name} has {show(unknown[0])}; it takes {', '.join(hints)} alone")
    return {key: _settle(inner, hints[key], f"{name}.{key}") for key, inner in given.items()}


def _mapping(value: Any, name: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise _Wrong(f"{name} is {show(value)}; it must map names to values")
    return value


def _wrong(value: Any, hint: Any, name: str) -> _Wrong:
    return _Wrong(f"{name} is {show(value)}; it must be {_describe(hint)}")


def _describe(hint: Any) -> str:
    if hint in _NUMBERS:
        return _NUMBERS[hint]
    if hint is types.NoneType:
        return "None"
    if typing.get_origin(hint) is Annotated:
        return str(typing.get_args(hint)[1])
    if typing.get_origin(hint) is tuple:
        return _describe_sequence(typing.get_args(hint))
    if not isinstance(hint, type):
        return str(hint)
    return f"{'an' if hint.__name__[0] in 'AEIO' else 'a'} {hint.__name__}"


def _describe_sequence(hints: Sequence[Any]) -> str:
    many = len(hints) == 1 or hints[1:] == (...,)
    count = "a tuple" if many else f"a tuple of {len(hints)}"
    return f"{count}, each {_describe(hints[0])}"


def _can_be_written(text: str) -> bool:
    return "\0" not in text and not any("\ud800" <= character <= "\udfff" for character in text)


def _is(one: object, other: object) -> bool:
    return one is other


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls, include_extras=not typing.is_typeddict(cls))
