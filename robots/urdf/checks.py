"""Refuses a URDF in clear words: names, numbers, shapes, masses, joints that make no tree."""

from __future__ import annotations

import posixpath
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from xml.etree.ElementTree import Element

from robot_layouts.core.errors import AssetError, closest_match, refuse
from robot_layouts.core.quoting import shown
from robots.urdf.model import SIZES, ModelJoint
from robots.urdf.text import LARGEST_LENGTH, expect_numbers, numbers_of, required_numbers

MAX_LINKS = 255  # of an articulation in PhysX 5, tried: with one more it has no joints, or crashes
LONGEST_NAME = 200  # characters
SMALLEST_SIZE = 1e-5  # m; PhysX's own tolerances are larger
SMALLEST = 1e-30  # kg, kg·m²; below it, what physics divides by leaves single precision

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
DRIVEN_TYPES = ("revolute", "continuous", "prismatic")
MOMENTS = ("ixx", "iyy", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")

# How many numbers the attributes of an element's parts have.
ORIGIN: Mapping[str, Mapping[str, int]] = {"origin": {"xyz": 3, "rpy": 3}}
JOINT_NUMBERS: Mapping[str, Mapping[str, int]] = {
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "dynamics": {"damping": 1, "friction": 1},
    **ORIGIN,
    "axis": {"xyz": 3},
    "mimic": {"multiplier": 1, "offset": 1},
}

_ROUNDING = 1e-12


def expect_readable(root: Element, urdf: str) -> None:
    """Refuse the text of a URDF whose parts are not what they should be, or make no tree.

    Args:
        root: The ``<robot>``.
        urdf: The URDF's path, for messages.

    Raises:
        AssetError: If names are missing, repeated or unknown, attributes are not the numbers that
            they should be, a shape is invalid, a body has no possible mass, or joints make no tree.
    """
    refuse(_problems(root, urdf), AssetError)


def _problems(root: Element, urdf: str) -> Iterator[str]:
    links, joints = root.findall("link"), root.findall("joint")
    if len(links) > MAX_LINKS:
        yield (
            f"{urdf} has {len(links)} links; PhysX joins {MAX_LINKS} at most. Links that are fixed"
            " to each other can be made one"
        )
    names = [link.get("name", "") for link in links]
    yield from _name_problems(urdf, "link", names)
    yield from _name_problems(urdf, "joint", [joint.get("name", "") for joint in joints])
    for joint in joints:
        yield from _joint_problems(joint, f"{urdf}: joint {joint.get('name')!r}")
    for link in links:
        for element in (*link.iterfind("collision"), *link.iterfind("visual")):
            yield from _shape_problems(element, f"{urdf}, link {link.get('name')!r}")
    yield from _tree_problems(names, joints, urdf)
    moved = moved_links(root)
    for link in links:
        where = f"{urdf}: link {link.get('name')!r}"
        yield from inertia_problems(link, where, moves=link.get("name") in moved)


def link_of(joint: Element, part: str) -> str:
    """Return the link that a joint names as its ``parent`` or ``child``; empty if it names none."""
    element = joint.find(part)
    return "" if element is None else element.get("link", "")


def moved_links(root: Element) -> set[str]:
    """Return the names of the links that a joint of a ``<robot>`` moves."""
    return {link_of(j, "child") for j in root.iterfind("joint") if j.get("type") != "fixed"}


def sizes_of(shape: Element, where: str) -> list[float]:
    """Return the sizes of a shape that is no mesh, in the order of `SIZES` (m).

    Raises:
        AssetError: If one is missing, no number, or beyond all measure.
    """
    return [
        size
        for attribute, count in SIZES[shape.tag].items()
        for size in required_numbers(shape, attribute, count, where, LARGEST_LENGTH)
    ]


def attributes_of(element: Element) -> str:
    """Return an element's attributes as messages show them."""
    return " ".join(f"{key}={value!r}" for key, value in element.items())


def _name_problems(urdf: str, kind: str, names: Iterable[str]) -> Iterator[str]:
    counts = Counter(names)
    if "" in counts:
        yield f"{urdf} has a {kind} without a name"
    for name in counts:
        if not name.isprintable() or len(name) > LONGEST_NAME:
            yield (
                f"{urdf} has a {kind} called {shown(name)}; names have at most {LONGEST_NAME}"
                " characters, all of them printable"
            )
    twice = sorted(name for name, count in counts.items() if count > 1)
    if twice:
        yield (
            f"{urdf} has more than one {kind} called {', '.join(map(repr, twice))};"
            f" every {kind} needs a name of its own"
        )


def _joint_problems(joint: Element, where: str) -> Iterator[str]:
    expect_numbers(joint, JOINT_NUMBERS, where)
    limit, axis = joint.find("limit"), joint.find("axis")
    for key in ("effort", "velocity"):
        (number,) = numbers_of(limit, key, (0.0,), where)
        if number < 0:
            yield f"{where} has {key}={number:g} in <limit>, below 0"
    if joint.get("type") != "fixed" and not any(numbers_of(axis, "xyz", (1.0, 0.0, 0.0), where)):
        yield f"{where} has the axis 0 0 0; an axis needs a direction"


def _shape_problems(element: Element, where: str) -> Iterator[str]:
    """Yield why a ``<collision>`` or ``<visual>`` is no shape."""
    what, kinds = f"a {element.tag}", ", ".join(SIZES)
    shapes = element.findall("geometry/*")
    if not shapes:
        yield f"{where}: {what} without a shape; choices: {kinds}"
    if len(shapes) > 1:
        yield (
            f"{where}: {what} with {len(shapes)} shapes ({', '.join(s.tag for s in shapes)}); each"
            f" needs a {element.tag} of its own"
        )
    (shape,) = shapes
    if shape.tag not in SIZES:
        yield f"{where}: {what} of shape {shown(shape.tag)}; choices: {kinds}"
    expect_numbers(element, ORIGIN, where)
    given = attributes_of(shape)
    if shape.tag == "mesh":
        if 0.0 in numbers_of(shape, "scale", (1.0, 1.0, 1.0), where):
            yield f"{where}: a mesh with {given} has no volume; leave no factor 0"
        file = shape.get("filename", "")
        if not file.strip() or posixpath.basename(file) == "":
            yield f"{where}: a mesh with filename={file!r}; it takes the path of a file"
        return
    least = min(sizes_of(shape, where))
    if element.tag == "collision" and least < SMALLEST_SIZE:
        yield (
            f"{where}: a collision shape without a volume: a {shape.tag} with {given}; sizes are"
            f" {SMALLEST_SIZE:g} m and more"
        )
    if least < 0:
        yield f"{where}: {what} of a {shape.tag} with {given}, below 0"


def _tree_problems(links: Sequence[str], joints: Sequence[Element], urdf: str) -> Iterator[str]:
    if not links:
        yield f"{urdf} has no link"
    ends = [(link_of(joint, "parent"), link_of(joint, "child")) for joint in joints]
    for joint, names in zip(joints, ends, strict=True):
        for name in names:
            if name not in links:
                match = closest_match(name, links)
                yield (
                    f"{urdf}: joint {joint.get('name')!r} names the link {shown(name)}, which does"
                    " not exist" + (f"; did you mean {match!r}?" if match else "")
                )
    carried = Counter(child for _, child in ends)
    twice = sorted(link for link, count in carried.items() if count > 1)
    if twice:
        yield f"{urdf}: more than one joint carries the link {twice[0]!r}; a URDF is a tree"
    roots = [link for link in links if link not in carried]
    if len(roots) != 1:
        what = f"links {roots} are" if roots else "no link is"
        yield f"{urdf}: {what} without a joint that carries it; a tree has one root"
    reached = {roots[0]}
    for _ in joints:
        reached |= {child for parent, child in ends if parent in reached}
    lost = [link for link in links if link not in reached]
    if lost:
        yield f"{urdf}: the joints of links {lost} go in a circle"


def inertia_problems(link: Element, where: str, *, moves: bool) -> Iterator[str]:
    """Yield why a link's ``<inertial>`` is incomplete, or describes no body.

    A link may leave ``<inertial>`` out, or give nothing but zeros: then SAPIEN takes mass and
    inertia from the collision shapes. A link that a joint moves must then have no shape at all:
    that is how URDFs put two joints in one place.

    Args:
        link: The ``<link>``.
        where: The URDF and the link, for messages.
        moves: Whether a joint moves it.

    Raises:
        AssetError: If a number is missing or none.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return
    expect_numbers(inertial, ORIGIN, where)
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        lacks = "<mass>" if mass is None else "<inertia>"
        yield f"{where} has an <inertial> without {lacks}; give both, or leave <inertial> out"
        return
    (weight,) = required_numbers(mass, "value", 1, where)
    moments, products = (
        [required_numbers(tensor, key, 1, where)[0] for key in keys] for keys in (MOMENTS, PRODUCTS)
    )
    shapes = link.find("collision") is not None or link.find("visual") is not None
    nothing = weight == 0 or not any((*moments, *products))
    if nothing and weight >= 0 and (not moves or not (shapes or any((weight, *moments)))):
        return
    if weight < SMALLEST or min(moments) < SMALLEST:
        listing = ", ".join(f"{moment:g}" for moment in moments)
        yield (
            f"{where}{' moves, but' if moves else ''} has mass {weight:g} kg and moments of inertia"
            f" {listing} kg·m²; all must be positive (leave <inertial> out, and they follow from"
            " the collision shapes)"
        )
    if not _is_positive(moments, products):
        listing = ", ".join(f"{number:g}" for number in (*moments, *products))
        yield (
            f"{where} has the inertia ixx, iyy, izz, ixy, ixz, iyz = {listing} kg·m², which no body"
            " has: around some axis it is not positive (are the signs or the units wrong?)"
        )


def _is_positive(moments: list[float], products: list[float]) -> bool:
    """Tell whether a symmetric matrix is positive definite."""
    import numpy as np

    (xx, yy, zz), (xy, xz, yz) = moments, products
    tensor = np.array([(xx, xy, xz), (xy, yy, yz), (xz, yz, zz)])
    return bool(np.linalg.eigvalsh(tensor / max(moments))[0] > _ROUNDING)


def expect_drivable(joints: Sequence[ModelJoint], urdf: str) -> None:
    """Refuse joints that cannot be driven.

    Args:
        joints: Those that move.
        urdf: The URDF's path, for messages.

    Raises:
        AssetError: If one is of another type, has limits that leave no way to go, or mimics what
            does not move, or itself.
    """
    refuse(_drive_problems(joints, urdf), AssetError)


def _drive_problems(joints: Sequence[ModelJoint], urdf: str) -> Iterator[str]:
    leaders = {joint.name: joint for joint in joints}
    for joint in joints:
        where = f"{urdf}: joint {joint.name!r}"
        if joint.type not in DRIVEN_TYPES:
            known = ", ".join(JOINT_TYPES)
            more = "" if joint.type in JOINT_TYPES else f" (the types are {known})"
            yield (
                f"{where} is {shown(joint.type)}{more}; only revolute, continuous, prismatic and"
                " fixed joints can be driven or left alone"
            )
        if joint.lower is not None and joint.upper is not None and not joint.lower < joint.upper:
            yield (
                f"{where} has the limits {joint.lower:g} … {joint.upper:g} {joint.unit}, which"
                " leave no way to go; give it <limit lower= upper=>, or make it continuous or fixed"
            )
        if joint.mimics is not None and joint.mimics not in leaders:
            yield f"{where} mimics {shown(joint.mimics)}, which is no joint that moves"
        if joint.mimics is not None and joint.multiplier == 0:
            yield f"{where} mimics with multiplier 0, so it never moves; make it fixed"
    for joint in joints:
        names = [joint.name]
        while (leader := leaders[names[-1]].mimics) is not None:
            if leader in names:
                way = " and ".join(names)
                yield f"{urdf}: joint {joint.name!r} mimics itself, by way of {way}"
            names.append(leader)
