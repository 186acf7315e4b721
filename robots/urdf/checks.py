"""Refuses a URDF in clear words: names, numbers, shapes, masses, joints that make no tree."""

from __future__ import annotations

import posixpath
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from xml.etree.ElementTree import Element

from robot_layouts.core.errors import AssetError, closest_match
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
    links, joints = root.findall("link"), root.findall("joint")
    if len(links) > MAX_LINKS:
        raise AssetError(
            f"{urdf} has {len(links)} links; PhysX joins {MAX_LINKS} at most. Links that are fixed"
            " to each other can be made one"
        )
    names = [link.get("name", "") for link in links]
    _expect_names(urdf, "link", names)
    _expect_names(urdf, "joint", [joint.get("name", "") for joint in joints])
    for joint in joints:
        _expect_joint(joint, f"{urdf}: joint {joint.get('name')!r}")
    for link in links:
        for element in (*link.iterfind("collision"), *link.iterfind("visual")):
            _expect_shape(element, f"{urdf}, link {link.get('name')!r}")
    _expect_tree(names, joints, urdf)
    moved = moved_links(root)
    for link in links:
        where = f"{urdf}: link {link.get('name')!r}"
        expect_inertia(link, where, moves=link.get("name") in moved)


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
        (number,) = numbers_of(limit, key, (0.0,), where)
        if number < 0:
            raise AssetError(f"{where} has {key}={number:g} in <limit>, below 0")
    if joint.get("type") != "fixed" and not any(numbers_of(axis, "xyz", (1.0, 0.0, 0.0), where)):
        raise AssetError(f"{where} has the axis 0 0 0; an axis needs a direction")


def _expect_shape(element: Element, where: str) -> None:
    """Refuse a ``<collision>`` or ``<visual>`` that is no shape."""
    what = f"a {element.tag}"
    shapes = element.findall("geometry/*")
    if not shapes:
        raise AssetError(f"{where}: {what} without a shape; choices: {', '.join(SIZES)}")
    if len(shapes) > 1:
        raise AssetError(
            f"{where}: {what} with {len(shapes)} shapes ({', '.join(s.tag for s in shapes)}); each"
            f" needs a {element.tag} of its own"
        )
    (shape,) = shapes
    if shape.tag not in SIZES:
        raise AssetError(
            f"{where}: {what} of shape {shown(shape.tag)}; choices: {', '.join(SIZES)}"
        )
    expect_numbers(element, ORIGIN, where)
    if shape.tag == "mesh":
        _expect_mesh(shape, where)
        return
    least = min(sizes_of(shape, where))
    if element.tag == "collision" and least < SMALLEST_SIZE:
        raise AssetError(
            f"{where}: a collision shape without a volume: a {shape.tag} with"
            f" {attributes_of(shape)}; sizes are {SMALLEST_SIZE:g} m and more"
        )
    if least < 0:
        raise AssetError(f"{where}: {what} of a {shape.tag} with {attributes_of(shape)}, below 0")


def _expect_mesh(mesh: Element, where: str) -> None:
    if 0.0 in numbers_of(mesh, "scale", (1.0, 1.0, 1.0), where):
        raise AssetError(
            f"{where}: a mesh with {attributes_of(mesh)} has no volume; leave no factor 0"
        )
    file = mesh.get("filename", "")
    if not file.strip() or posixpath.basename(file) == "":
        raise AssetError(f"{where}: a mesh with filename={file!r}; it takes the path of a file")


def _expect_tree(links: Sequence[str], joints: Sequence[Element], urdf: str) -> None:
    if not links:
        raise AssetError(f"{urdf} has no link")
    ends = [(link_of(joint, "parent"), link_of(joint, "child")) for joint in joints]
    for joint, names in zip(joints, ends, strict=True):
        for name in names:
            if name not in links:
                match = closest_match(name, links)
                raise AssetError(
                    f"{urdf}: joint {joint.get('name')!r} names the link {shown(name)}, which does"
                    " not exist" + (f"; did you mean {match!r}?" if match else "")
                )
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


def expect_inertia(link: Element, where: str, *, moves: bool) -> None:
    """Refuse a link whose ``<inertial>`` is incomplete, or describes no body.

    A link may leave ``<inertial>`` out, or give nothing but zeros: then SAPIEN takes mass and
    inertia from the collision shapes. A link that a joint moves must then have no shape at all:
    that is how URDFs put two joints in one place.

    Args:
        link: The ``<link>``.
        where: The URDF and the link, for messages.
        moves: Whether a joint moves it.

    Raises:
        AssetError: If a number is missing or none, a mass or moment is not positive, or the
            tensor is not that of a body.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return
    expect_numbers(inertial, ORIGIN, where)
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        lacks = "<mass>" if mass is None else "<inertia>"
        raise AssetError(
            f"{where} has an <inertial> without {lacks}; give both, or leave <inertial> out"
        )
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
        raise AssetError(
            f"{where}{' moves, but' if moves else ''} has mass {weight:g} kg and moments of inertia"
            f" {listing} kg·m²; all must be positive (leave <inertial> out, and they follow from"
            " the collision shapes)"
        )
    if not _is_positive(moments, products):
        listing = ", ".join(f"{number:g}" for number in (*moments, *products))
        raise AssetError(
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
    leaders = {joint.name: joint for joint in joints}
    for joint in joints:
        where = f"{urdf}: joint {joint.name!r}"
        if joint.type not in DRIVEN_TYPES:
            known = ", ".join(JOINT_TYPES)
            more = "" if joint.type in JOINT_TYPES else f" (the types are {known})"
            raise AssetError(
                f"{where} is {shown(joint.type)}{more}; only revolute, continuous, prismatic and"
                " fixed joints can be driven or left alone"
            )
        if joint.lower is not None and joint.upper is not None and not joint.lower < joint.upper:
            raise AssetError(
                f"{where} has the limits {joint.lower:g} … {joint.upper:g} {joint.unit}, which"
                " leave no way to go; give it <limit lower= upper=>, or make it continuous or fixed"
            )
        if joint.mimics is not None and joint.mimics not in leaders:
            raise AssetError(f"{where} mimics {shown(joint.mimics)}, which is no joint that moves")
        if joint.mimics is not None and joint.multiplier == 0:
            raise AssetError(f"{where} mimics with multiplier 0, so it never moves; make it fixed")
    for joint in joints:
        names = [joint.name]
        while (leader := leaders[names[-1]].mimics) is not None:
            if leader in names:
                raise AssetError(
                    f"{urdf}: joint {joint.name!r} mimics itself, by way of {' and '.join(names)}"
                )
            names.append(leader)
