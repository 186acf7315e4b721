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
from robots.urdf.checks import link_of
from robots.urdf.cleaning.links import drop_zones, fill_ends, repair_inertia, repair_shapes
from robots.urdf.cleaning.references import file_states, repair_references
from robots.urdf.cleaning.xacro_files import drop_leftovers, is_unfinished
from robots.urdf.paths import opened_folders
from robots.urdf.text import numbers_of, parse_xml

PARTS = ("link", "joint", "material")  # of a robot; the rest belongs to other programs
FREE = ("floating", "planar")  # types of joints that place a robot rather than move it
BOUNDED = ("revolute", "prismatic")
NOTHING = 1e-3  # of a joint's range; what it may go by and still not move
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
    """Return whether a URDF is a template, and its meshes."""
    root, _ = _parse_damaged(xml, urdf)
    meshes = [mesh.get("filename", "") for mesh in root.iterfind("link/*/geometry/mesh")]
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
    """Declare every prefix that an element uses without declaring it."""
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


def _repair_joints(root: Element, urdf: str) -> Iterator[str]:
    """Repair joints that say that they do not move, or say too much."""
    joints = root.findall("joint")
    yield from _fix_base(joints)
    for joint in joints:
        bounded = joint.get("type") in BOUNDED and joint.find("limit") is not None
        if bounded and _limits(joint, urdf) == (0.0, 0.0):
            _fix(joint)
            yield (
                f"joint {joint.get('name')!r} has the limits 0 … 0, which are those of a <limit>"
                " that has none, so it is fixed (if it should turn freely, make it continuous)"
            )
        elif joint.get("type") == "continuous":
            yield from _without_limits(joint)
        elif joint.get("type") == "fixed" and (mimic := joint.find("mimic")) is not None:
            joint.remove(mimic)
            yield f"joint {joint.get('name')!r} is fixed, so what it mimics counts for nothing"
    yield from _fix_followers(joints, urdf)
    yield from _turn_followers(joints, urdf)


def _fix_base(joints: list[Element]) -> Iterator[str]:
    """Fix a joint by which the whole robot would fly or drive: a layout says where it stands."""
    carried = {link_of(joint, "child") for joint in joints}
    for joint in joints:
        kind, parent = joint.get("type", ""), link_of(joint, "parent")
        if kind not in FREE or parent in carried:
            continue
        if sum(link_of(other, "parent") == parent for other in joints) == 1:
            _fix(joint)
            yield (
                f"joint {joint.get('name')!r}, by which the whole robot is {kind}, is fixed: a"
                " layout says where it stands"
            )


def _limits(joint: Element, urdf: str) -> tuple[float, float]:
    """Return both limits of a joint, which by the standard are 0 where they are left out."""
    where, limit = f"{urdf}: joint {joint.get('name')!r}", joint.find("limit")
    (low,), (high,) = (numbers_of(limit, key, (0.0,), where) for key in ("lower", "upper"))
    return low, high


def _without_limits(joint: Element) -> Iterator[str]:
    limit = joint.find("limit")
    if limit is None or not {"lower", "upper"} & {*limit.keys()}:
        return
    ends = [limit.attrib.pop(key, "none") for key in ("lower", "upper")]
    yield (
        f"joint {joint.get('name')!r} is continuous, so its limits {' … '.join(ends)} rad count"
        " for nothing"
    )


def _fix_followers(joints: list[Element], urdf: str) -> Iterator[str]:
    """Fix the joints that mimic a joint that is fixed, and would stay where they are."""
    fixed = {joint.get("name") for joint in joints if joint.get("type") == "fixed"}
    waiting = [joint for joint in joints if joint.get("type") != "fixed"]
    while follower := next((j for j in waiting if _follows(j, fixed, urdf)), None):
        waiting.remove(follower)
        _fix(follower)
        fixed.add(follower.get("name"))
        yield f"joint {follower.get('name')!r} mimics a joint that is fixed, so it is fixed"


def _follows(joint: Element, fixed: set[str | None], urdf: str) -> bool:
    mimic = joint.find("mimic")
    if mimic is None or mimic.get("joint") not in fixed:
        return False
    where = f"{urdf}: joint {joint.get('name')!r}"
    return numbers_of(mimic, "offset", (0.0,), where) == (0.0,)


def _turn_followers(joints: list[Element], urdf: str) -> Iterator[str]:
    """Turn the multipliers of joints that mimic others, where the sign is wrong.

    Their limits leave them no way to follow then, and with the other sign all of it.
    """
    named = {joint.get("name"): joint for joint in joints}
    for joint in joints:
        mimic = joint.find("mimic")
        leader = None if mimic is None else named.get(mimic.get("joint"))
        own, led = _span(joint, urdf), _span(leader, urdf)
        if mimic is None or own is None or led is None:
            continue
        where = f"{urdf}: joint {joint.get('name')!r}"
        (factor,) = numbers_of(mimic, "multiplier", (1.0,), where)
        (offset,) = numbers_of(mimic, "offset", (0.0,), where)
        ways = [_within(own, led, sign * factor, offset) for sign in (1, -1)]
        if ways[0] < NOTHING and ways[1] > 1 - NOTHING:
            mimic.set("multiplier", f"{-factor:.17g}")
            yield (
                f"joint {joint.get('name')!r} mimics {mimic.get('joint')!r} times {factor:g}, out"
                f" of its own limits; it is taken times {-factor:g}, which stays within them"
            )


def _span(joint: Element | None, urdf: str) -> tuple[float, float] | None:
    """Return the limits of a joint that has two different ones."""
    if joint is None or joint.get("type") not in BOUNDED:
        return None
    low, high = _limits(joint, urdf)
    return (low, high) if low < high else None


def _within(
    own: tuple[float, float], led: tuple[float, float], factor: float, offset: float
) -> float:
    """Return the share of the way on which it is led that lies within a joint's own limits."""
    low, high = sorted(factor * end + offset for end in led)
    common = min(high, own[1]) - max(low, own[0])
    return max(common, 0.0) / (high - low) if high > low else 1.0


def _fix(joint: Element) -> None:
    joint.set("type", "fixed")
    for part in ("axis", "limit", "dynamics", "mimic", "safety_controller", "calibration"):
        for element in joint.findall(part):
            joint.remove(element)


_STEPS: tuple[Callable[[Element, str], Iterator[str]], ...] = (
    drop_leftovers,
    _drop_foreign,
    _drop_commas,
    _repair_joints,
    repair_references,
    repair_shapes,
    drop_zones,
    fill_ends,
    repair_inertia,
)
