"""Gives links a mass and an inertia where a URDF gives none that a body can have."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement

from robot_layouts.core.errors import AssetError
from robots.urdf.checks import (
    MOMENTS,
    PRODUCTS,
    SMALLEST,
    expect_inertia,
    moved_links,
    sizes_of,
)
from robots.urdf.mesh_files import read_corners
from robots.urdf.paths import resolve
from robots.urdf.text import numbers_of

if TYPE_CHECKING:
    from robot_layouts.kinematics.rotations import Floats

DENSITY = 1000.0  # kg/m³; what SAPIEN takes for collision shapes
THINNEST = 1e-3  # m; of a body whose shapes are thinner

Size = tuple[float, float, float]


def repair_inertia(root: Element, urdf: str) -> Iterator[str]:
    """Replace what no body has by what mass and size of the link give, and yield what was done.

    Args:
        root: The ``<robot>``.
        urdf: Its path, by which it refers to meshes.
    """
    moved = moved_links(root)
    for link in root.iterfind("link"):
        name = link.get("name", "")
        where = f"{urdf}: link {name!r}"
        try:
            expect_inertia(link, where, moves=name in moved)
        except AssetError:
            with suppress(AssetError):  # numbers that are none are refused later
                yield from _repair(link, where, urdf)


def _repair(link: Element, where: str, urdf: str) -> Iterator[str]:
    (inertial, *_) = link.findall("inertial")
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    (weight,) = numbers_of(mass, "value", (0.0,), where)
    moments = [numbers_of(tensor, key, (0.0,), where)[0] for key in (*MOMENTS, *PRODUCTS)]
    if weight < 0 or 0 < weight < SMALLEST:
        return
    if tensor is not None and (products := _complete(tensor)) and _is_possible(link, where):
        yield f"link {link.get('name')!r} has an inertia without {', '.join(products)}, taken as 0"
        return
    what = _problem(tensor, moments)
    size = _size(link, where, urdf)
    if weight == 0 and link.find("collision") is not None:
        link.remove(inertial)
        yield (
            f"link {link.get('name')!r} has no mass: mass and inertia follow from its collision"
            f" shapes and {DENSITY:g} kg/m³"
        )
    elif weight == 0 and size is None:
        link.remove(inertial)
        yield f"link {link.get('name')!r} has no mass, so its <inertial> was left out"
    else:
        words = "" if weight else f"no mass: took {DENSITY:g} kg/m³; and "
        weight = weight or DENSITY * math.prod(size or (0.0,))
        _set_box(inertial, weight, size or _ball(weight))
        body = _in_words(weight, size)
        yield f"link {link.get('name')!r} has {words}{what}: took that of {body}"


def _complete(tensor: Element) -> list[str]:
    """Set the products of inertia that are missing to 0, and return their names."""
    missing = [key for key in PRODUCTS if key not in tensor.keys()]  # noqa: SIM118
    for key in missing:
        tensor.set(key, "0")
    return missing


def _is_possible(link: Element, where: str) -> bool:
    try:
        expect_inertia(link, where, moves=True)
    except AssetError:
        return False
    return True


def _problem(tensor: Element | None, numbers: list[float]) -> str:
    if tensor is None or not any(numbers):
        return "no inertia"
    listing = ", ".join(f"{number:g}" for number in numbers)
    return f"the inertia {listing} kg·m² (xx, yy, zz, xy, xz, yz), which no body has"


def _ball(weight: float) -> Size:
    """Return the edges of a cube that turns as heavily as a ball of a weight (m)."""
    radius = (3 * weight / (4 * math.pi * DENSITY)) ** (1 / 3)
    return (radius * math.sqrt(2.4),) * 3


def _in_words(weight: float, size: Size | None) -> str:
    if size is None:
        return f"a ball of {weight:.3g} kg and {DENSITY:g} kg/m³, as it has no shape"
    edges = " × ".join(f"{edge:.3g}" for edge in size)
    return f"a box of {weight:.3g} kg and the size of its shapes, {edges} m"


def _set_box(inertial: Element, weight: float, size: Size) -> None:
    """Make the inertia that of a solid box along the link's axes."""
    for part in ("mass", "inertia"):
        for element in inertial.findall(part):
            inertial.remove(element)
    origin = inertial.find("origin")
    if origin is not None:
        origin.set("rpy", "0 0 0")
    SubElement(inertial, "mass", value=repr(weight))
    x, y, z = (edge * edge * weight / 12 for edge in size)
    moments = {"ixx": y + z, "iyy": x + z, "izz": x + y}
    numbers = {key: repr(max(moment, SMALLEST)) for key, moment in moments.items()}
    SubElement(inertial, "inertia", {**numbers, **dict.fromkeys(PRODUCTS, "0")})


def _size(link: Element, where: str, urdf: str) -> Size | None:
    """Return the extents of a link's collision shapes, else of its visuals, or None (m)."""
    import numpy as np

    for kind in ("collision", "visual"):
        corners = [
            made
            for shape in link.iterfind(kind)
            if (made := _corners(shape, where, urdf)) is not None
        ]
        if corners:
            x, y, z = np.maximum(np.ptp(np.concatenate(corners), axis=0), THINNEST).tolist()
            return (x, y, z)
    return None


def _corners(element: Element, where: str, urdf: str) -> Floats | None:
    """Return the corners of what a shape fills in the link's frame, (n, 3) (m), or None."""
    import numpy as np

    from robot_layouts.kinematics.rotations import rpy_pose

    try:
        own = _own_corners(element, where, urdf)
        origin = element.find("origin")
        xyz, rpy = (numbers_of(origin, key, (0.0, 0.0, 0.0), where) for key in ("xyz", "rpy"))
    except (AssetError, ValueError):
        return None
    pose = rpy_pose(xyz, rpy)
    return np.asarray(own) @ pose[:3, :3].T + pose[:3, 3]


def _own_corners(element: Element, where: str, urdf: str) -> Any:
    (shape,) = element.findall("geometry/*")
    if shape.tag == "mesh":
        scale = numbers_of(shape, "scale", (1.0, 1.0, 1.0), where)
        path = resolve(shape.get("filename", ""), urdf, os.path.isfile)
        return read_corners(path, scale, where, urdf)
    x, y, z = (edge / 2 for edge in _edges(shape.tag, sizes_of(shape, where)))
    return [(a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z)]


def _edges(kind: str, sizes: list[float]) -> Size:
    if kind == "box":
        x, y, z = sizes
        return (x, y, z)
    diameter = 2 * sizes[0]
    if kind == "sphere":
        return (diameter, diameter, diameter)
    return (diameter, diameter, sizes[1] + (diameter if kind == "capsule" else 0.0))
