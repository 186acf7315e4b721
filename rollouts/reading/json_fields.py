"""What json of recordings must look like, as data, and one function that holds values to it."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_ABSENT = object()
_shown = reprlib.Repr()

Field = tuple[str, Any, "Kind"]


class FieldError(ValueError):
    """A value that is not as it must be; the message names its place and what would be right."""


@dataclass(frozen=True)
class Kind:
    """A kind of value.

    Attributes:
        words: What such a value is, to end the sentence "it must be …".
        fits: Whether a value is of this kind, without looking inside.
        inside: The values inside one, each with its name and kind.
    """

    words: str
    fits: Callable[[Any], bool]
    inside: Callable[[Any], Iterator[Field]] = lambda value: iter(())

    def expect(self, value: Any, where: str) -> None:
        """Refuse a value of another kind, or with something inside that does not fit.

        Args:
            value: What was read from json.
            where: What to call it.

        Raises:
            FieldError: If it does not fit.
        """
        if value is _ABSENT:
            raise FieldError(f"it has no {where}; that must be {self.words}")
        if not self.fits(value):
            raise FieldError(f"{where or 'it'} is {_shown.repr(value)}; it must be {self.words}")
        for name, inner, kind in self.inside(value):
            kind.expect(inner, f"{where}{name}".removeprefix("."))


def whole(least: int, most: int) -> Kind:
    """Return the kind of whole numbers in a range; true and false are none."""

    def fits(value: Any) -> bool:
        return type(value) is int and least <= value <= most

    return Kind(f"a whole number from {least} to {most}", fits)


def maybe(kind: Kind) -> Kind:
    """Return the kind of values that are null or of another kind."""
    return either(kind, NOTHING)


def either(*kinds: Kind) -> Kind:
    """Return the kind of values that are of one of several."""

    def chosen(value: Any) -> Kind | None:
        return next((kind for kind in kinds if kind.fits(value)), None)

    def inside(value: Any) -> Iterator[Field]:
        kind = chosen(value)
        return kind.inside(value) if kind else iter(())

    words = " or ".join(kind.words for kind in kinds)
    return Kind(words, lambda value: chosen(value) is not None, inside)


def items(kind: Kind, length: int | None = None) -> Kind:
    """Return the kind of lists whose values are all of one kind."""

    def fits(value: Any) -> bool:
        return isinstance(value, list) and length in (None, len(value))

    def inside(value: Sequence[Any]) -> Iterator[Field]:
        return ((f"[{number}]", inner, kind) for number, inner in enumerate(value))

    return Kind("a list" if length is None else f"a list of {length} values", fits, inside)


def by_name(kind: Kind) -> Kind:
    """Return the kind of objects whose values are all of one kind."""

    def inside(value: Mapping[str, Any]) -> Iterator[Field]:
        return ((f".{name}", inner, kind) for name, inner in value.items())

    return Kind("an object", lambda value: isinstance(value, dict), inside)


def fields(required: Mapping[str, Kind], optional: Mapping[str, Kind] | None = None) -> Kind:
    """Return the kind of objects that have some fields and may have others; more are allowed."""

    def inside(value: Mapping[str, Any]) -> Iterator[Field]:
        for name, kind in required.items():
            yield f".{name}", value.get(name, _ABSENT), kind
        for name, kind in (optional or {}).items():
            if name in value:
                yield f".{name}", value[name], kind

    return Kind("an object", lambda value: isinstance(value, dict), inside)


def _is_number(value: Any) -> bool:
    if type(value) is int:
        return abs(value) <= 2**53
    return isinstance(value, float) and math.isfinite(value)


NOTHING = Kind("null", lambda value: value is None)
TEXT = Kind("a text", lambda value: isinstance(value, str))
NAME = Kind("a text of 1 to 200 characters", lambda v: isinstance(v, str) and 0 < len(v) <= 200)
FLAG = Kind("true or false", lambda value: isinstance(value, bool))
NUMBER = Kind("a finite number", _is_number)
ANYTHING = Kind("anything", lambda value: True)
OBJECT = by_name(ANYTHING)
