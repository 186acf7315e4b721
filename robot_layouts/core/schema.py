"""What a value must be, as a type: one check for files, for users' dictionaries, for declarations.

msgspec checks. A bare ``float`` is finite and fits in single precision, in which worlds are
computed; a bare ``str`` is not empty, and UTF-8 can hold it. ``Annotated`` with msgspec's ``Meta``
says otherwise, and a ``Meta`` with a description says it in a message.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, Union

import msgspec
from msgspec import Meta
from typing_extensions import NotRequired, TypedDict, get_type_hints, is_typeddict

from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.quoting import shown

LARGEST = 3.4028234663852886e38  # of single precision

Text = Annotated[
    str,
    Meta(
        pattern=r"(?s)^(?=.*\S)[^\0\ud800-\udfff]+\Z", description="a text (not empty, in Unicode)"
    ),
]
AnyText = Annotated[str, Meta(description="a text")]
Name = Annotated[
    str, Meta(min_length=1, max_length=200, description="a text of 1 to 200 characters")
]
Finite = Annotated[
    float,
    Meta(ge=-sys.float_info.max, le=sys.float_info.max, description="a finite number"),
]
"""Of double precision, as files hold what no world computes with."""
Object = dict[str, Any]
Digest = Annotated[
    str, Meta(pattern="^[0-9a-f]{64}\\Z", description="a SHA-256: 64 of the digits 0-9 and a-f")
]


class FieldError(ValueError):
    """A value of a file that is not as it must be."""


def within(low: float, high: float, unit: str = "", kind: str = "number") -> Meta:
    """Return the bounds of a number, both included, for an ``Annotated`` one.

    Args:
        low: The smallest number allowed.
        high: The largest number allowed.
        unit: Their unit; none if empty.
        kind: What the number is called.
    """
    words = f"a {kind} from {low:g} to {high:g}{unit and f' {unit}'}"
    return Meta(ge=low, le=high, description=words)


def whole(low: int, high: int) -> Meta:
    """Return the bounds of a whole number, both included."""
    return Meta(ge=low, le=high, description=f"a whole number from {low} to {high}")


def length(count: int) -> Meta:
    """Return how many entries a list has."""
    return Meta(min_length=count, max_length=count, description=f"a list of {count} values")


def exactly(*texts: str) -> Meta:
    """Return the only texts that there may be, such as the format of a file."""
    return Meta(pattern=rf"^({'|'.join(texts)})\Z", description=" or ".join(map(repr, texts)))


def check(value: Any, hint: Any, name: str, error: Callable[[str], Exception] = FieldError) -> Any:
    """Return a value as an annotation has it.

    Lists become tuples where tuples are declared, and numbers of other libraries become Python's.
    Of objects, fields that no ``TypedDict`` declares are left out.

    Args:
        value: Whatever was given.
        hint: ``bool``, ``int``, ``float``, ``str``, a class, a union, a tuple, a list, a sequence,
            a mapping from names, a ``Literal``, a ``TypedDict``, or one of these ``Annotated``.
        name: What messages call it; empty for the whole of a file.
        error: What to raise.

    Raises:
        Exception: ``error``, if it is no such thing; says where, and what it would take.
    """
    try:
        return msgspec.convert(value, _strict(hint))
    except (msgspec.ValidationError, ValueError):
        value = _plain(value)
    try:
        return msgspec.convert(value, _strict(hint))
    except (msgspec.ValidationError, ValueError):
        raise error(_wrong(value, hint, name)) from None


def check_fields(instance: Any, error: type[RobotLayoutsError], owner: str | None = None) -> None:
    """Check every field of a frozen dataclass against its annotation; only for `__post_init__`.

    Args:
        instance: The dataclass that is being made.
        error: What to raise.
        owner: What messages call it; its class, if not given.

    Raises:
        RobotLayoutsError: ``error``, if a field is no such thing.
    """
    hints, record = _declared(type(instance))
    given = vars(instance)
    try:
        settled = msgspec.convert(given, record)
    except (msgspec.ValidationError, ValueError):
        owner = owner or type(instance).__name__
        settled = {n: check(given[n], h, f"{owner}: {n}", error) for n, h in hints.items()}
    given.update(settled)


@functools.cache
def _declared(cls: type) -> tuple[dict[str, Any], Any]:
    """Return the annotations of a dataclass's fields, and what msgspec makes of all of them."""
    known = get_type_hints(cls, include_extras=True)
    hints = {field.name: known[field.name] for field in dataclasses.fields(cls)}
    return hints, _strict(_typed_dict(cls.__name__, hints))


# -- what msgspec checks -------------------------------------------------------------------------


class _Tested(type):
    """A class whose instances are whatever passes a test; msgspec takes one as it is."""

    test: Callable[[Any], bool]

    def __instancecheck__(cls, instance: Any) -> bool:
        return cls.test(instance)


_INT = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
_BARE = {int: _INT, float: _INT | Annotated[float, Meta(ge=-LARGEST, le=LARGEST)], str: Text}
_typed_dict: Any = TypedDict  # of names and annotations that are only known at run time
_KEPT = (Any, bool, types.NoneType)


@functools.lru_cache(None)
def _strict(hint: Any) -> Any:
    """Return an annotation as msgspec is to check it."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _KEPT or origin is Literal:
        return hint
    if hint in _BARE:
        return _BARE[hint]
    if origin is Annotated:
        return _strict_annotated(hint, *arguments)
    if origin in (Union, types.UnionType):
        parts = [_strict(part) for part in arguments]
        others = [part for part in parts if part is not types.NoneType]
        if len(others) > 1 and any(isinstance(part, _Tested) for part in others):
            return _Tested("Any", (), {"test": lambda value: any(_fits(value, p) for p in parts)})
        return Union[tuple(parts)]  # pyright: ignore  # noqa: UP007
    if origin is tuple:
        return tuple[tuple(part if part is ... else _strict(part) for part in arguments)]
    if origin is Sequence:
        return tuple[_strict(arguments[0]), ...]
    if origin is list:
        return list[_strict(arguments[0])]
    if origin in (Mapping, dict):
        return dict[_strict(arguments[0]), _strict(arguments[1])]
    if is_typeddict(hint):
        kinds = {
            key: _strict(kind) if required else NotRequired[_strict(kind)]
            for key, (kind, required) in _keys(hint).items()
        }
        return _typed_dict(hint.__name__, kinds)
    return _Tested(hint.__name__, (), {"test": lambda value: isinstance(value, hint)})


def _strict_annotated(hint: Any, plain: Any, meta: Meta) -> Any:
    if plain not in (int, float):
        return hint if plain is str else Annotated[_strict(plain), meta]
    least = -(2**63) if meta.ge is None else max(-(2**63), math.ceil(meta.ge))
    most = 2**63 - 1 if meta.le is None else min(2**63 - 1, math.floor(meta.le))
    whole_number = Annotated[int, Meta(ge=least, le=most)]
    return whole_number if plain is int else whole_number | hint


def _fits(value: Any, strict: Any) -> bool:
    try:
        msgspec.convert(value, strict)
    except (msgspec.ValidationError, ValueError):
        return False
    return True


def _plain(value: Any) -> Any:
    """Return a value with Python's own numbers and lists for those of numpy and torch."""
    if hasattr(value, "tolist") and not isinstance(value, type):
        return value.tolist()
    if isinstance(value, (tuple, list)):
        return type(value)(map(_plain, value)) if type(value) in (tuple, list) else value
    return {k: _plain(v) for k, v in value.items()} if isinstance(value, dict) else value


@functools.cache
def _keys(hint: Any) -> dict[str, tuple[Any, bool]]:
    """Return of each key of a ``TypedDict`` what it takes, and whether it must be there."""
    keys: dict[str, tuple[Any, bool]] = {}
    for key, kind in get_type_hints(hint, include_extras=True).items():
        optional = typing.get_origin(kind) is NotRequired
        required = key in hint.__required_keys__ and not optional
        keys[key] = (typing.get_args(kind)[0] if optional else kind, required)
    return keys


# -- what is wrong, in words ---------------------------------------------------------------------


def _wrong(value: Any, hint: Any, name: str) -> str:
    """Say what is wrong with a value that does not fit, as far inside as it can be told."""
    shape = _shape_of(value, hint)
    for place, inner, kind in _inside(value, shape, name):
        if inner is _ABSENT:
            return f"it has no {place}; that must be {_words(kind)}"
        if not _fits(inner, _strict(kind)):
            return _wrong(inner, kind, place)
    count = f"has {len(value)} entries" if _is_short(value, shape) else f"is {shown(value)}"
    return f"{name or 'it'} {count}; it must be {_words(shape)}"


_ABSENT = object()


def _shape_of(value: Any, hint: Any) -> Any:
    """Return the part of an annotation that a value is of the kind of, if there is one such part.

    Bounds are left out where what is inside a sequence is wrong.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated and typing.get_origin(arguments[0]) is not None:
        return hint if _fits(value, _strict(arguments[0])) else _shape_of(value, arguments[0])
    if origin in (Union, types.UnionType):
        alike = [_shape_of(value, part) for part in arguments if _is_alike(value, part)]
        return alike[0] if len(alike) == 1 else hint
    return hint


def _is_alike(value: Any, hint: Any) -> bool:
    origin = typing.get_origin(hint)
    if isinstance(value, Mapping):
        return origin in (Mapping, dict) or is_typeddict(hint)
    return isinstance(value, (list, tuple)) and origin in (tuple, list, Sequence)


def _inside(value: Any, hint: Any, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Return what is inside a value: what messages call it, itself, its annotation."""
    arguments = typing.get_args(hint)
    if not _is_alike(value, hint):
        return
    if is_typeddict(hint):
        for key, (kind, required) in _keys(hint).items():
            if required or key in value:
                yield f"{name}.{key}".removeprefix("."), value.get(key, _ABSENT), kind
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield f"a name in {name or 'it'}", key, arguments[0]
            yield f"{name}[{shown(key)}]", inner, arguments[1]
    elif not _is_short(value, hint):
        fixed = typing.get_origin(hint) is tuple and arguments[1:] != (...,)
        kinds = arguments if fixed else [arguments[0]] * len(value)
        for index, (inner, kind) in enumerate(zip(value, kinds, strict=True)):
            yield f"{name}[{index}]", inner, kind


def _is_short(value: Any, hint: Any) -> bool:
    """Whether a sequence has another length than a tuple that is declared."""
    arguments = typing.get_args(hint)
    fixed = typing.get_origin(hint) is tuple and arguments[1:] != (...,)
    return fixed and isinstance(value, (list, tuple)) and len(value) != len(arguments)


_WORDS = {
    Any: "anything",
    bool: "True or False",
    int: "a whole number",
    float: "a finite number (below 3.4e38)",
    str: "a text (not empty, in Unicode)",
    types.NoneType: "None",
}


def _words(hint: Any) -> str:
    """Return what an annotation takes, to end the sentence "it must be …"."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return arguments[1].description or _words(arguments[0])
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is Literal:
        return " or ".join(map(repr, arguments))
    if origin in (Union, types.UnionType):
        return " or ".join(map(_words, arguments))
    if origin in (tuple, list, Sequence):
        fixed = origin is tuple and arguments[1:] != (...,)
        count = f" of {len(arguments)}" if fixed else ""
        kind = "list" if origin is list else "tuple"
        return f"a {kind}{count}, each {_words(arguments[0])}"
    if origin is dict or is_typeddict(hint):
        return "an object"
    if origin is Mapping:
        return "a mapping from names to values"
    return f"{'an' if hint.__name__[0] in 'AEIO' else 'a'} {hint.__name__}"
