"""The structure of PLY files, which SAPIEN's reader takes on trust: broken ones crash it."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice

# struct's letter of each type.
TYPES = {
    **dict.fromkeys(("char", "int8"), "b"),
    **dict.fromkeys(("uchar", "uint8"), "B"),
    **dict.fromkeys(("short", "int16"), "h"),
    **dict.fromkeys(("ushort", "uint16"), "H"),
    **dict.fromkeys(("int", "int32"), "i"),
    **dict.fromkeys(("uint", "uint32"), "I"),
    **dict.fromkeys(("float", "float32"), "f"),
    **dict.fromkeys(("double", "float64"), "d"),
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """A kind of record: the types of its properties, two of a list, by their names."""

    name: str
    count: int
    types: dict[str, tuple[str, ...]] = field(default_factory=dict)


def check_ply(contents: bytes) -> None:
    """Refuse a PLY file whose header or faces make no sense.

    Raises:
        ValueError: If they do not; says why.
    """
    head, end, body = contents.partition(b"end_header")
    match = re.fullmatch(rb"[ \t]*(\r?\n)(.*)", body, re.DOTALL)
    lines = head.decode("latin-1").split("\n")
    if not (end and match) or lines[0].strip() != "ply":
        raise ValueError("it is no PLY file: it has no header")
    order, elements = _header(lines[1:])
    known = {element.name: element for element in elements}
    if len(known) < len(elements) or not {"vertex", "face"} <= set(known):
        raise ValueError("its header needs one element vertex and one element face")
    vertex, face = known["vertex"].types, known["face"].types
    lists = [name for name in INDICES if len(face.get(name, ())) == 2]
    if not ({"x", "y", "z"} <= set(vertex) and lists):
        raise ValueError("its header needs x, y and z of each vertex, and vertex_indices of faces")
    values = _Binary(match[2], order) if order else _Ascii(match[2])
    for element in elements:
        kinds = [types[0] for types in element.types.values() if len(types) == 1]
        if len(kinds) == len(element.types):
            values.skip("".join(kinds), element.count)
            continue
        for _ in range(element.count):
            for name, types in element.types.items():
                _check_property(values, name, types, known["vertex"].count)


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    order: str | None = None
    elements = [_Element("", 0)]
    for line in lines:
        match line.split():
            case ["format", name, "1.0"] if name in ORDERS and order is None:
                order = ORDERS[name]
            case ["element", name, count] if count.isdecimal() and count.isascii():
                elements.append(_Element(name, int(count)))
            case ["property", "list", *types, name] if len(types) == 2:
                elements[-1].types[name] = (TYPES[types[0]], TYPES[types[1]])
            case ["property", kind, name] if name not in elements[-1].types:
                elements[-1].types[name] = (TYPES[kind],)
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"its header has the line {line[:60]!r}")
    if order is None:
        raise ValueError("its header names no format")
    if elements[0].types:
        raise ValueError("its header has a property of nothing")
    return order, elements[1:]


class _Binary:
    """Values one after the other, as bytes."""

    def __init__(self, body: bytes, order: str) -> None:
        self._body, self._order, self._at = body, order, 0

    def take(self, kind: str, count: int) -> tuple[float, ...]:
        form = f"{self._order}{count}{kind}"
        values = struct.unpack_from(form, self._body, self._at)
        self._at += struct.calcsize(form)
        return values

    def skip(self, kinds: str, count: int) -> None:
        self._at += struct.calcsize(f"{self._order}{kinds}") * count


class _Ascii:
    """Values one after the other, as words."""

    def __init__(self, body: bytes) -> None:
        self._words: Iterator[bytes] = iter(body.split())

    def take(self, kind: str, count: int) -> tuple[float, ...]:
        read = float if kind in "fd" else int
        return tuple(read(next(self._words, b"")) for _ in range(count))

    def skip(self, kinds: str, count: int) -> None:
        for _ in islice(self._words, len(kinds) * count):
            pass


def _check_property(
    values: _Binary | _Ascii, name: str, types: tuple[str, ...], corners: int
) -> None:
    try:
        count = int(values.take(types[0], 1)[0]) if len(types) == 2 else 1
        found = values.take(types[-1], count)
    except (struct.error, ValueError, OverflowError) as error:
        raise ValueError("it ends before its last face, or has a word for a number") from error
    if name in INDICES and not (count >= 3 and 0 <= min(found) and max(found) < corners):
        raise ValueError(f"it has a face between {list(found)[:8]} of its {corners} corners")
