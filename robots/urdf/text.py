"""The text of a URDF: XML that may come from anyone, its numbers and names, and parts to write."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robot_layouts.core.errors import AssetError
from robot_layouts.core.quoting import shown
from robot_layouts.kinematics.quaternions import quaternion_rpy
from robots.parts import Quaternion, Vector3

if TYPE_CHECKING:
    from robot_layouts.kinematics.rotations import Floats

MAX_DEPTH = 100  # elements inside one another; the deepest Collada meshes have about 20

# Beyond it, squares and quotients leave the range of single precision, in which physics computes.
LARGEST = 1e18
LARGEST_LENGTH = 1e4  # m

# As C and Python both read it; Python alone also takes 1_000 and the digits of other scripts.
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class _DocumentTypeError(Exception):
    """A text has a document type, in which entities are declared."""


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree, and stops where a document type begins."""

    def doctype(self, *_: Any) -> None:
        raise _DocumentTypeError


def parse_xml(xml: bytes, file: str, kind: str) -> Element:
    """Return the root element of an XML file.

    Args:
        xml: The file's contents, in any encoding that they declare.
        file: Its path, for messages.
        kind: What it should be, for messages, such as ``"a URDF"``.

    Raises:
        AssetError: If it is no XML, has a document type, which is where entities are declared,
            or nests elements deeper than `MAX_DEPTH`.
    """
    try:
        root = ElementTree.fromstring(xml, ElementTree.XMLParser(target=_Builder()))
    except _DocumentTypeError:
        raise AssetError(f"{file} declares XML entities; {kind} has no use for them") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # unknown encodings
        raise AssetError(f"{file} is not {kind}: {error}") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
    if depth > MAX_DEPTH:
        raise AssetError(f"{file} nests elements deeper than {MAX_DEPTH} levels")
    return root


def numbers_of(
    element: Element | None, attribute: str, default: tuple[float, ...], where: str
) -> Any:
    """Return the finite numbers of an attribute, as many as ``default`` has.

    Args:
        element: The element, or None for the default.
        attribute: Its attribute.
        default: What it means to leave the attribute out.
        where: What the element belongs to, for messages.

    Raises:
        AssetError: If there are more or fewer numbers, or some word is no number, or one that is
            not finite or too large.
    """
    if element is None or element.get(attribute) is None:
        return default
    return required_numbers(element, attribute, len(default), where)


def required_numbers(
    element: Element, attribute: str, count: int, where: str, largest: float | None = None
) -> tuple[float, ...]:
    """Return the numbers of an attribute that cannot be left out; see `numbers_of`.

    Args:
        element: The element.
        attribute: Its attribute.
        count: How many numbers it has.
        where: What the element belongs to, for messages.
        largest: The largest amount of a number; None is `LARGEST_LENGTH` for ``xyz``, else
            `LARGEST`.

    Raises:
        AssetError: If it is left out, or as `numbers_of`.
    """
    text = element.get(attribute)
    need = f"{count} finite number{'s are' if count > 1 else ' is'} needed"
    if text is None:
        raise AssetError(f"{where} has no {attribute} in <{element.tag}>; {need}")
    parts = text.split()
    known = text.isascii() and all(map(_NUMBER.fullmatch, parts))
    numbers = tuple(map(float, parts)) if known else ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise AssetError(f"{where} has {attribute}={shown(text)} in <{element.tag}>; {need}")
    if largest is None:
        largest = LARGEST_LENGTH if attribute == "xyz" and element.tag == "origin" else LARGEST
    if max(map(abs, numbers)) > largest:
        raise AssetError(
            f"{where} has {attribute}={shown(text)} in <{element.tag}>; {largest:g} is the largest"
            " amount that makes sense"
        )
    return numbers


def expect_numbers(element: Element, counts: Mapping[str, Mapping[str, int]], where: str) -> None:
    """Refuse attributes of an element's parts that are not so many finite numbers.

    Args:
        element: The element.
        counts: For each of its parts, how many numbers each attribute has; all may be left out.
        where: What the element belongs to, for messages.

    Raises:
        AssetError: As `numbers_of`.
    """
    for part, attributes in counts.items():
        found = element.find(part)
        for attribute in attributes if found is not None else ():
            numbers_of(found, attribute, (0.0,) * attributes[attribute], where)


def text(*numbers: float) -> str:
    """Return numbers as a URDF has them, to the last digit."""
    return " ".join(repr(float(number)) for number in numbers)


def origin_at(position: Vector3, quaternion: Quaternion) -> dict[str, str]:
    """Return the attributes of an ``<origin>``.

    Args:
        position: m.
        quaternion: wxyz.
    """
    return {"xyz": text(*position), "rpy": text(*quaternion_rpy(quaternion))}


def origin_of(pose: Floats) -> dict[str, str]:
    """Return the attributes of the ``<origin>`` of a pose, (4, 4) (m)."""
    from robot_layouts.kinematics.rotations import quaternion_of  # NumPy, for which others wait

    x, y, z = pose[:3, 3].tolist()
    a, b, c, d = quaternion_of(pose[:3, :3]).tolist()
    return origin_at((x, y, z), (a, b, c, d))


def joint_element(name: str, kind: str, parent: str, child: str, origin: dict[str, str]) -> Element:
    """Return a joint.

    Args:
        name: Its name.
        kind: Its type, such as ``"fixed"``.
        parent: The link that carries it.
        child: The link that it carries.
        origin: Of that one in the frame of the other; see `origin_of`.
    """
    made = Element("joint", name=name, type=kind)
    SubElement(made, "parent", link=parent)
    SubElement(made, "child", link=child)
    SubElement(made, "origin", origin)
    return made
