"""Reads a URDF: yourdfpy parses what `robots.urdf.checks` lets through.

Left to itself yourdfpy takes for numbers what no other reader does and repairs broken text by
guesses. It knows no capsules, and keeps matrices for roll, pitch and yaw, with last digits of its
own; so capsules go to it as cylinders, and poses are composed from the text.
"""

from __future__ import annotations

import io
import math
from copy import deepcopy
from functools import lru_cache
from typing import Any
from xml.etree.ElementTree import Element, tostring

from robot_layouts.core.errors import AssetError
from robot_layouts.kinematics.rotations import Floats, rpy_pose
from robots.urdf.checks import expect_drivable, expect_readable
from robots.urdf.model import Inertial, ModelJoint, UrdfModel, UrdfShape
from robots.urdf.summary import parse_urdf
from robots.urdf.text import numbers_of

UNREAD = ("material", "calibration", "safety_controller")  # what no model holds


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
    robot = _load(root, urdf)
    links = list(zip(robot.links, root.iterfind("link"), strict=True))
    model = UrdfModel(
        name=robot.name,
        links=tuple(link.name for link in robot.links),
        joints=tuple(map(_joint, robot.joints, root.iterfind("joint"))),
        collisions={
            link.name: _shapes(link.collisions, text, "collision", urdf)
            for link, text in links
            if link.collisions
        },
        visuals={
            link.name: _shapes(link.visuals, text, "visual", urdf)
            for link, text in links
            if link.visuals
        },
        inertials={
            link.name: Inertial(
                link.inertial.mass, _origin(text.find("inertial")), link.inertial.inertia
            )
            for link, text in links
            if link.inertial
        },
    )
    expect_drivable(model.moving, urdf)
    return model


def _load(root: Element, urdf: str) -> Any:
    """Return the robot that yourdfpy reads in a ``<robot>``."""
    import yourdfpy  # brings trimesh, which takes half a second to load

    plain = deepcopy(root)
    plain.set("name", root.get("name", ""))
    for capsule in list(plain.iter("capsule")):
        capsule.tag = "cylinder"
    for element in (plain, *plain.iterfind("link/visual"), *plain.iterfind("joint")):
        for part in [part for part in element if part.tag in UNREAD]:
            element.remove(part)
    text = io.BytesIO(tostring(plain, encoding="utf-8"))
    try:
        return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
    except Exception as error:  # a reader that raises whatever it meets
        reason = str(error) or type(error).__name__
        raise AssetError(f"yourdfpy cannot read {urdf}: {reason}") from error


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


def _shapes(shapes: list[Any], link: Element, kind: str, urdf: str) -> tuple[UrdfShape, ...]:
    return tuple(
        UrdfShape(
            kind=next(text.iterfind("geometry/*")).tag,
            sizes=_sizes(shape.geometry),
            file="" if shape.geometry.mesh is None else shape.geometry.mesh.filename,
            origin=_origin(text),
            where=f"{urdf}, link {link.get('name')!r}",
        )
        for shape, text in zip(shapes, link.iterfind(kind), strict=True)
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


def _origin(text: Element | None) -> Floats:
    origin = None if text is None else text.find("origin")
    zeros = (0.0, 0.0, 0.0)
    return rpy_pose(numbers_of(origin, "xyz", zeros, ""), numbers_of(origin, "rpy", zeros, ""))
