"""Refuses the text of a URDF before any library reads it: names, numbers, shapes, no tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError, closest_match
from robots.urdf.inertia import expect_inertia
from robots.urdf.numbers import expect_numbers, required_numbers, shown
from robots.urdf.shapes import ORIGIN, expect_shape

MAX_LINKS = 255  # of an articulation in PhysX 5, tried: with one more it has no joints, or crashes
LONGEST_NAME = 200  # characters

JOINT_NUMBERS: Mapping[str, Mapping[str, int]] = {
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "dynamics": {"damping": 1, "friction": 1},
    **ORIGIN,
    "axis": {"xyz": 3},
    "mimic": {"multiplier": 1, "offset": 1},
}


def expect_readable(root: Element, urdf: str) -> None:
    """Refuse the text of a URDF whose parts are not what they should be, or make no tree.

    Args:
        root: The ``<robot>``.
        urdf: The URDF's path, for messages.

    Raises:
        AssetError: If names are missing, repeated or unknown, attributes are not the numbers that
            they should be, a shape is none, a body has no possible mass, or joints make no tree.
    """
    links, joints = root.findall("link"), root.findall("joint")
    _expect_few(urdf, len(links))
    _expect_names(urdf, "link", [link.get("name", "") for link in links])
    _expect_names(urdf, "joint", [joint.get("name", "") for joint in joints])
    for joint in joints:
        _expect_joint(joint, f"{urdf}: joint {joint.get('name')!r}")
    for link in links:
        for element in (*link.iterfind("collision"), *link.iterfind("visual")):
            expect_shape(element, f"{urdf}, link {link.get('name')!r}")
    _expect_tree([link.get("name", "") for link in links], joints, urdf)
    moved = {link_of(joint, "child") for joint in joints if joint.get("type") != "fixed"}
    for link in links:
        where = f"{urdf}: link {link.get('name')!r}"
        expect_inertia(link, where, moves=link.get("name") in moved)


def link_of(joint: Element, part: str) -> str:
    """Return the link that a joint names as its ``parent`` or ``child``; empty if it names none."""
    element = joint.find(part)
    return "" if element is None else element.get("link", "")


def _expect_few(urdf: str, links: int) -> None:
    if links > MAX_LINKS:
        raise AssetError(
            f"{urdf} has {links} links; PhysX joins {MAX_LINKS} at most. Links that are fixed to"
            " each other can be made one"
        )


def _expect_names(urdf: str, kind: str, names: Iterable[str]) -> None:
    counts = Counter(names)
    if "" in counts:
        raise AssetError(f"{urdf} has a {kind} without a name")
    for name in counts:
        if not name.isprintable() or len(name) > LONGEST_NAME:
            raise AssetError(
                f"{urdf} has a {kind} called {shown(name)}; names have at most {LONGEST_NAME}"
                " characters, all of them printable"
            )
    twice = sorted(name for name, count in counts.items() if count > 1)
    if twice:
        raise AssetError(
            f"{urdf} has more than one {kind} called {', '.join(map(repr, twice))};"
            f" every {kind} needs a name of its own"
        )


def _expect_joint(joint: Element, where: str) -> None:
    expect_numbers(joint, JOINT_NUMBERS, where)
    limit, axis = joint.find("limit"), joint.find("axis")
    for key in ("effort", "velocity"):
        if limit is not None and key in limit.keys():
            (number,) = required_numbers(limit, key, 1, where)
            if number < 0:
                raise AssetError(f"{where} has {key}={number:g} in <limit>, below 0")
    if axis is not None and "xyz" in axis.keys() and joint.get("type") != "fixed":
        if not any(required_numbers(axis, "xyz", 3, where)):
            raise AssetError(f"{where} has the axis 0 0 0; an axis needs a direction")


def _expect_tree(links: Sequence[str], joints: Sequence[Element], urdf: str) -> None:
    if not links:
        raise AssetError(f"{urdf} has no link")
    ends = [(link_of(joint, "parent"), link_of(joint, "child")) for joint in joints]
    known = set(links)
    for joint, names in zip(joints, ends, strict=True):
        for name in names:
            if name not in known:
                where = f"{urdf}: joint {joint.get('name')!r}"
                raise AssetError(f"{where} names {_unknown_link(name, links)}")
    carried = Counter(child for _, child in ends)
    twice = sorted(link for link, count in carried.items() if count > 1)
    if twice:
        raise AssetError(
            f"{urdf}: more than one joint carries the link {twice[0]!r}; a URDF is a tree"
        )
    roots = [link for link in links if link not in carried]
    if len(roots) != 1:
        what = f"links {roots} are" if roots else "no link is"
        raise AssetError(f"{urdf}: {what} without a joint that carries it; a tree has one root")
    reached = {roots[0]}
    for _ in joints:
        reached |= {child for parent, child in ends if parent in reached}
    lost = [link for link in links if link not in reached]
    if lost:
        raise AssetError(f"{urdf}: the joints of links {lost} go in a circle")


def _unknown_link(name: str, links: Sequence[str]) -> str:
    match = closest_match(name, links)
    return f"the link {shown(name)}, which does not exist" + (
        f"; did you mean {match!r}?" if match else ""
    )
