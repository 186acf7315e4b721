"""The one place at which a URDF is repaired, before anything else reads it.

Repaired is what has a clear meaning and would stop a reader; each repair is one sentence. What has
no clear meaning stays as it is, and `robots.urdf.checks` refuses it. A URDF that needs no repair
keeps every byte.
"""

from __future__ import annotations

import posixpath
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from xml.etree.ElementTree import Element, tostring

from robot_layouts.core.errors import AssetError
from robots.urdf.cleaning.inertia import repair_inertia
from robots.urdf.cleaning.joints import repair_joints
from robots.urdf.cleaning.references import file_states, repair_references
from robots.urdf.cleaning.shapes import repair_shapes
from robots.urdf.cleaning.xacro_files import drop_leftovers, is_unfinished
from robots.urdf.paths import opened_folders
from robots.urdf.text import parse_xml

PARTS = ("link", "joint", "material")  # of a robot; the rest belongs to other programs
VECTORS = ("xyz", "rpy", "size", "scale")  # attributes of three numbers

_PREFIX = re.compile(rb"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]")
_ROBOT = re.compile(rb"<robot(?=[\s>])")


@dataclass(frozen=True)
class Cleaned:
    """A URDF that was repaired where it was clear how.

    Attributes:
        xml: Its contents.
        repairs: What was repaired, one sentence each.
    """

    xml: bytes
    repairs: tuple[str, ...]


def clean(xml: bytes, urdf: str) -> Cleaned:
    """Repair a URDF; the same contents, with the same files beside them, are repaired once.

    Args:
        xml: The URDF's contents.
        urdf: Its path, by which it refers to files.

    Raises:
        AssetError: If it is no XML.
    """
    _, references = _first_look(xml, urdf)
    opened = opened_folders(posixpath.dirname(urdf))
    return _clean(xml, urdf, (file_states(references, urdf), opened))


def is_template(xml: bytes, urdf: str) -> bool:
    """Tell whether a URDF is a xacro template, of which more is left than unused definitions.

    Raises:
        AssetError: If it is no XML.
    """
    return _first_look(xml, urdf)[0]


@lru_cache(maxsize=64)
def _first_look(xml: bytes, urdf: str) -> tuple[bool, tuple[str, ...]]:
    """Return whether a URDF is a template, and the meshes that it collides with."""
    root, _ = _parse_damaged(xml, urdf)
    meshes = [mesh.get("filename", "") for mesh in root.iterfind("link/collision/geometry/mesh")]
    return is_unfinished(root), tuple(meshes)


@lru_cache(maxsize=64)
def _clean(xml: bytes, urdf: str, files: object) -> Cleaned:
    root, repairs = _parse_damaged(xml, urdf)
    if root.tag != "robot" or is_unfinished(root):
        return Cleaned(xml, ())
    for step in _STEPS:
        with suppress(AssetError):  # which the checks that follow raise again
            repairs += step(root, urdf)
    return Cleaned(tostring(root, encoding="utf-8") if repairs else xml, tuple(repairs))


def _parse_damaged(xml: bytes, urdf: str) -> tuple[Element, list[str]]:
    """Return the root element of a URDF, and what had to be repaired to read it.

    Raises:
        AssetError: If it is no XML all the same.
    """
    repairs: list[str] = []
    if xml[:1].isspace():
        xml = xml.lstrip()
        if xml.startswith(b"<?xml"):
            repairs.append("blank lines before <?xml …?>, left out")
    try:
        root = parse_xml(xml, urdf, "a URDF")
    except AssetError as error:
        if "unbound prefix" not in str(error):
            raise
        xml, prefixes = _with_namespaces(xml)
        root = parse_xml(xml, urdf, "a URDF")
        repairs.append(f"namespaces that were not declared: {', '.join(prefixes)}")
    space, closed, name = root.tag.partition("}")
    if closed and name == "robot":
        for element in root.iter():
            element.tag = element.tag.removeprefix(f"{space}}}")
        repairs.append(f"the namespace {space[1:]!r} of <robot>, left out")
    return root, repairs


def _with_namespaces(xml: bytes) -> tuple[bytes, list[str]]:
    """Declare every prefix that an element has and nobody declared."""
    used = {match.decode("ascii", "replace") for match in _PREFIX.findall(xml)}
    prefixes = sorted(p for p in used - {"xml", "xmlns"} if f"xmlns:{p}=".encode() not in xml)
    known = {"xacro": "http://www.ros.org/wiki/xacro"}
    declared = "".join(f' xmlns:{p}="{known.get(p, f"undeclared:{p}")}"' for p in prefixes)
    return _ROBOT.sub(lambda found: found[0] + declared.encode(), xml, count=1), prefixes


def _drop_foreign(root: Element, urdf: str) -> Iterator[str]:
    foreign = [element for element in root if element.tag not in PARTS]
    for element in foreign:
        root.remove(element)
    if foreign:
        counts = Counter(element.tag.rpartition("}")[2] for element in foreign)
        listing = ", ".join(f"<{name}> × {count}" for name, count in sorted(counts.items()))
        yield f"elements of other programs, left out: {listing}"


def _drop_commas(root: Element, urdf: str) -> Iterator[str]:
    changed = 0
    for element in root.iter():
        for key in VECTORS:
            value = element.get(key, "")
            if "," in value and len(value.replace(",", " ").split()) == 3:
                element.set(key, value.replace(",", " "))
                changed += 1
    if changed:
        yield f"commas between the numbers of vectors, left out: {changed} times"


_STEPS: tuple[Callable[[Element, str], Iterator[str]], ...] = (
    drop_leftovers,
    _drop_foreign,
    _drop_commas,
    repair_joints,
    repair_references,
    repair_shapes,
    repair_inertia,
)
