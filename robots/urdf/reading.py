"""Reads a URDF: yourdfpy reads the joints and inertias that `robots.urdf.checks` lets through.

Left to itself yourdfpy takes for numbers what no other reader does and repairs broken text by
guesses. It knows no capsules, and keeps matrices for roll, pitch and yaw, with last digits of its
own; so shapes are read here, and poses are composed from the text.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from robot_layouts.core.errors import AssetError
from robot_layouts.core.paths import cached
from robot_layouts.kinematics.rotations import Floats, rpy_pose
from robots.urdf.checks import expect_drivable, expect_readable, sizes_of
from robots.urdf.model import LinkInertia, ModelJoint, UrdfModel, UrdfShape
from robots.urdf.summary import parse_urdf, read_urdf
from robots.urdf.text import numbers_of

_METHOD = b"urdf 1"  # to be raised when something else is read of the same contents
_MATRICES = ("origin", "tensor")
UNREAD = ("visual", "collision", "calibration", "safety_controller")  # what it need not read


_Part = TypeVar("_Part", UrdfShape, ModelJoint, LinkInertia)


def model_of(urdf: Path) -> UrdfModel:
    """Return the tree that a URDF on this machine describes, repaired where it is clear how.

    Raises:
        AssetError: As `robots.urdf.summary.read_urdf` and `read_model`.
        MissingPackageError: If it is a template and xacro is not installed.
    """
    return read_model(read_urdf(urdf), urdf.as_posix())


@lru_cache(maxsize=64)
def read_model(xml: bytes, urdf: str) -> UrdfModel:
    """Return the tree that a URDF describes; the same contents are read once in a process.

    Those of a URDF in the local copy are read once altogether; see `robot_layouts.core.paths`.

    Args:
        xml: The URDF's contents.
        urdf: Its path, for messages.

    Raises:
        AssetError: If it is no URDF, it has more links than PhysX can join, names are missing,
            repeated or unknown, its joints make no tree or have impossible limits, a link that
            moves has no mass or inertia, or a shape has no size or is of no known kind.
    """
    return _model(cached(urdf, (_METHOD, urdf.encode(), xml), lambda: asdict(_read(xml, urdf))))


def _read(xml: bytes, urdf: str) -> UrdfModel:
    root = parse_urdf(xml, urdf)
    expect_readable(root, urdf)
    robot = _load(root, urdf)
    links = {link.get("name", ""): link for link in root.iterfind("link")}
    shapes = {
        kind: {name: found for name, link in links.items() if (found := _shapes(link, kind, urdf))}
        for kind in ("collision", "visual")
    }
    model = UrdfModel(
        name=robot.name,
        links=tuple(links),
        joints=tuple(map(_joint, robot.joints, root.iterfind("joint"))),
        collisions=shapes["collision"],
        visuals=shapes["visual"],
        inertials={
            link.name: LinkInertia(
                link.inertial.mass,
                _origin(links[link.name].find("inertial")),
                link.inertial.inertia,
            )
            for link in robot.links
            if link.inertial
        },
    )
    expect_drivable(model.moving, urdf)
    return model


def _model(plain: Mapping[str, Any]) -> UrdfModel:
    """Return the model that was made plain data."""
    shapes = {
        kind: {link: tuple(_made(UrdfShape, own)) for link, own in plain[kind].items()}
        for kind in ("collisions", "visuals")
    }
    names, inertias = plain["inertials"], plain["inertials"].values()
    return UrdfModel(
        name=plain["name"],
        links=tuple(plain["links"]),
        joints=tuple(_made(ModelJoint, plain["joints"])),
        inertials=dict(zip(names, _made(LinkInertia, inertias), strict=True)),
        **shapes,
    )


def _made(cls: type[_Part], rows: Iterable[Mapping[str, Any]]) -> list[_Part]:
    found: list[_Part] = []
    for row in rows:
        own = dict(row)
        for name, value in row.items():
            if isinstance(value, list):
                own[name] = np.array(value) if name in _MATRICES else tuple(value)
        found.append(cls(**own))
    return found


def _load(root: Element, urdf: str) -> Any:
    """Return the robot that yourdfpy reads in a ``<robot>``, without its shapes."""
    import yourdfpy  # brings trimesh, which takes half a second to load

    plain = Element("robot", name=root.get("name", ""))
    for element in (*root.iterfind("link"), *root.iterfind("joint")):
        parts = [part for part in element if part.tag not in UNREAD]
        SubElement(plain, element.tag, element.attrib).extend(parts)
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


def _shapes(link: Element, kind: str, urdf: str) -> tuple[UrdfShape, ...]:
    where = f"{urdf}, link {link.get('name')!r}"
    return tuple(_shape(element, where) for element in link.iterfind(kind))


def _shape(element: Element, where: str) -> UrdfShape:
    (shape,) = element.iterfind("geometry/*")
    mesh = shape.tag == "mesh"
    sizes = numbers_of(shape, "scale", (1.0, 1.0, 1.0), where) if mesh else sizes_of(shape, where)
    file = shape.get("filename", "") if mesh else ""
    return UrdfShape(shape.tag, tuple(sizes), file, _origin(element), where)


def _origin(text: Element | None) -> Floats:
    origin = None if text is None else text.find("origin")
    zeros = (0.0, 0.0, 0.0)
    return rpy_pose(numbers_of(origin, "xyz", zeros, ""), numbers_of(origin, "rpy", zeros, ""))
