"""Reads a URDF: refuses it in clear words, or has yourdfpy read what is left.

This is the one place at which a URDF is given to yourdfpy, and it is given only what a model holds
and `robots.urdf.text_checks` let through: left to itself it takes for a number what C does not,
repairs broken text by guesses, and ends in any error at what it does not expect. It has no
capsules; they go to it as cylinders, with their kind as the shape's name. Roll, pitch and yaw are
not kept by it, only matrices with last digits of its own, so poses are composed in `kinematics`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from kinematics.rotations import Floats, rpy_pose
from robots.common.errors import AssetError
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.numbers import numbers_of, shown
from robots.urdf.shapes import SIZES, UrdfShape
from robots.urdf.summary import parse_urdf
from robots.urdf.text_checks import JOINT_NUMBERS, expect_readable, link_of

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
DRIVEN_TYPES = ("revolute", "continuous", "prismatic")

READ_AS = {"capsule": "cylinder"}


@lru_cache(maxsize=64)
def read_model(xml: bytes, urdf: str) -> UrdfModel:
    """Return the tree that a URDF describes; the same contents are read once in a process.

    Args:
        xml: The URDF's contents.
        urdf: Its path, for messages.

    Raises:
        AssetError: If it is no URDF, it has more links than PhysX can join, names are missing,
            repeated or unknown, its joints make no tree or have impossible limits, a link that
            moves has no mass or inertia, or a shape has no size or is of no known kind.
    """
    root = parse_urdf(xml, urdf)
    expect_readable(root, urdf)
    model = _read(root, urdf)
    leaders = {joint.name: joint for joint in model.moving}
    for joint in model.moving:
        _expect_possible(joint, leaders, urdf)
    return model


def _read(root: Element, urdf: str) -> UrdfModel:
    import yourdfpy  # brings trimesh, which takes half a second to load

    text = io.BytesIO(tostring(_plain(root), encoding="utf-8"))
    try:
        robot: Any = yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
    except Exception as error:  # a reader that raises whatever it meets
        reason = str(error) or type(error).__name__
        raise AssetError(f"yourdfpy cannot read {urdf}: {reason}") from error
    return UrdfModel(
        name=robot.name,
        links=tuple(link.name for link in robot.links),
        joints=tuple(map(_joint, robot.joints, root.iterfind("joint"))),
        collisions=_by_link(robot, root, "collision", urdf),
        visuals=_by_link(robot, root, "visual", urdf),
    )


def _plain(root: Element) -> Element:
    """Return a robot that has what a model holds, and nothing else."""
    plain = Element("robot", name=root.get("name", ""))
    for link in root.iterfind("link"):
        copy = SubElement(plain, "link", name=link.get("name", ""))
        for kind in ("visual", "collision"):
            copy.extend(map(_plain_shape, link.iterfind(kind)))
    plain.extend(map(_plain_joint, root.iterfind("joint")))
    return plain


def _plain_shape(element: Element) -> Element:
    (shape,) = element.iterfind("geometry/*")
    plain = Element(element.tag, name=shape.tag)
    kept = (*SIZES[shape.tag], "filename", "scale")
    numbers = {key: value for key, value in shape.items() if key in kept}
    SubElement(SubElement(plain, "geometry"), READ_AS.get(shape.tag, shape.tag), numbers)
    return plain


def _plain_joint(joint: Element) -> Element:
    plain = Element("joint", name=joint.get("name", ""), type=joint.get("type", ""))
    for end in ("parent", "child"):
        SubElement(plain, end, link=link_of(joint, end))
    for part in ("axis", "limit", "mimic"):
        _copy(joint, plain, part, ("joint", *JOINT_NUMBERS[part]))
    return plain


def _copy(element: Element, plain: Element, part: str, attributes: Iterable[str]) -> None:
    found = element.find(part)
    if found is not None:
        kept = {key: value for key in attributes if (value := found.get(key)) is not None}
        SubElement(plain, part, kept)


def _joint(joint: Any, text: Element) -> ModelJoint:
    limit, mimic = joint.limit, joint.mimic
    bounded = joint.type in ("revolute", "prismatic")
    length = math.hypot(*joint.axis) or 1.0
    x, y, z = (float(number) / length for number in joint.axis)
    return ModelJoint(
        name=joint.name,
        type=joint.type,
        parent=joint.parent,
        child=joint.child,
        origin=_origin(text),
        axis=(x, y, z),
        lower=(limit and limit.lower) or 0.0 if bounded else None,
        upper=(limit and limit.upper) or 0.0 if bounded else None,
        effort=limit and limit.effort,
        velocity=limit and limit.velocity,
        mimics=None if mimic is None else mimic.joint or "",
        multiplier=1.0 if mimic is None else mimic.multiplier,
        offset=0.0 if mimic is None else mimic.offset,
    )


def _by_link(robot: Any, root: Element, kind: str, urdf: str) -> dict[str, tuple[UrdfShape, ...]]:
    """Return the shapes of every link that has some, of the kind ``collision`` or ``visual``."""
    shapes: dict[str, tuple[UrdfShape, ...]] = {}
    for link, text in zip(robot.links, root.iterfind("link"), strict=True):
        where = f"{urdf}, link {link.name!r}"
        if made := _shapes(getattr(link, f"{kind}s"), text.iterfind(kind), where):
            shapes[link.name] = made
    return shapes


def _shapes(shapes: Iterable[Any], texts: Iterable[Element], where: str) -> tuple[UrdfShape, ...]:
    return tuple(
        UrdfShape(
            kind=shape.name,
            sizes=_sizes(shape.geometry),
            file="" if shape.geometry.mesh is None else shape.geometry.mesh.filename,
            origin=_origin(text),
            where=where,
        )
        for shape, text in zip(shapes, texts, strict=True)
    )


def _sizes(geometry: Any) -> tuple[float, ...]:
    if geometry.mesh is not None:
        scale = geometry.mesh.scale
        return (1.0, 1.0, 1.0) if scale is None else tuple(scale.tolist())
    if geometry.box is not None:
        return tuple(geometry.box.size.tolist())
    if geometry.sphere is not None:
        return (geometry.sphere.radius,)
    return (geometry.cylinder.radius, geometry.cylinder.length)


def _origin(text: Element) -> Floats:
    origin = text.find("origin")
    xyz, rpy = (numbers_of(origin, key, (0.0, 0.0, 0.0), "") for key in ("xyz", "rpy"))
    return rpy_pose(xyz, rpy)


def _expect_possible(joint: ModelJoint, leaders: dict[str, ModelJoint], urdf: str) -> None:
    where = f"{urdf}: joint {joint.name!r}"
    if joint.type not in DRIVEN_TYPES:
        known = ", ".join(JOINT_TYPES)
        more = "" if joint.type in JOINT_TYPES else f" (the types are {known})"
        raise AssetError(
            f"{where} is {shown(joint.type)}{more}; only revolute, continuous, prismatic and fixed"
            " joints can be driven or left alone"
        )
    if joint.lower is not None and joint.upper is not None and not joint.lower < joint.upper:
        raise AssetError(
            f"{where} has the limits {joint.lower:g} … {joint.upper:g} {joint.unit}, which leave"
            " no way to go; give it <limit lower= upper=>, or make it continuous or fixed"
        )
    if joint.mimics is not None:
        if joint.mimics not in leaders:
            raise AssetError(f"{where} mimics {shown(joint.mimics)}, which is no joint that moves")
        if joint.multiplier == 0:
            raise AssetError(f"{where} mimics with multiplier 0, so it never moves; make it fixed")
        _leader(joint, leaders, where)


def _leader(joint: ModelJoint, leaders: dict[str, ModelJoint], where: str) -> None:
    seen = [joint.name]
    leader = leaders.get(joint.mimics or "")
    while leader is not None:
        if leader.name in seen:
            raise AssetError(f"{where} mimics itself, by way of {' and '.join(seen)}")
        seen.append(leader.name)
        leader = leaders.get(leader.mimics or "")
