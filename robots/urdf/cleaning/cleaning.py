"""The one place at which a URDF is repaired, before anything else reads it.

Repaired is what has a clear meaning and would stop a reader; each repair is one sentence. What has
no clear meaning stays as it is, and `robots.urdf.text_checks` refuses it. A URDF that needs no
repair keeps every byte.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from xml.etree.ElementTree import Element, tostring

from robots.common.errors import AssetError
from robots.urdf.cleaning.inertia import repair_inertia
from robots.urdf.cleaning.joints import repair_joints
from robots.urdf.cleaning.references import file_states, repair_references
from robots.urdf.cleaning.shapes import repair_shapes
from robots.urdf.cleaning.text import parse_damaged
from robots.urdf.cleaning.xacro_files import drop_leftovers, is_unfinished

PARTS = ("link", "joint", "material")  # of a robot; the rest belongs to other programs
VECTORS = ("xyz", "rpy", "size", "scale")  # attributes of three numbers


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
    return _clean(xml, urdf, file_states(_references(xml, urdf), urdf))


@lru_cache(maxsize=64)
def is_template(xml: bytes, urdf: str) -> bool:
    """Tell whether a URDF is a xacro template, of which more is left than unused definitions.

    Raises:
        AssetError: If it is no XML.
    """
    return is_unfinished(parse_damaged(xml, urdf)[0])


@lru_cache(maxsize=64)
def _references(xml: bytes, urdf: str) -> tuple[str, ...]:
    root, _ = parse_damaged(xml, urdf)
    return tuple(mesh.get("filename", "") for mesh in root.iterfind("link/collision/geometry/mesh"))


@lru_cache(maxsize=64)
def _clean(xml: bytes, urdf: str, files: object) -> Cleaned:
    root, repairs = parse_damaged(xml, urdf)
    if root.tag != "robot" or is_unfinished(root):
        return Cleaned(xml, ())
    for step in _STEPS:
        with suppress(AssetError):  # which the checks that follow raise again
            repairs += step(root, urdf)
    return Cleaned(tostring(root, encoding="utf-8") if repairs else xml, tuple(repairs))


def _drop_foreign(root: Element, urdf: str) -> Iterator[str]:
    counts: dict[str, int] = {}
    for element in [element for element in root if element.tag not in PARTS]:
        root.remove(element)
        name = element.tag.rpartition("}")[2]
        counts[name] = counts.get(name, 0) + 1
    if counts:
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
