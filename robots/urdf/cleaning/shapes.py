"""Gives each shape of a URDF an element of its own, and leaves out those without extent."""

from __future__ import annotations

import os
from collections.abc import Iterator
from copy import deepcopy
from xml.etree.ElementTree import Element, SubElement

from robot_layouts.core.errors import AssetError
from robots.urdf.checks import SMALLEST_SIZE, attributes_of, sizes_of
from robots.urdf.mesh_files import has_body
from robots.urdf.model import SIZES
from robots.urdf.paths import resolve
from robots.urdf.text import numbers_of

KINDS = ("visual", "collision")


def repair_shapes(root: Element, urdf: str) -> Iterator[str]:
    """Take shapes apart, leave out those without extent, and yield what was done.

    Args:
        root: The ``<robot>``.
        urdf: Its path, by which it refers to meshes.
    """
    for link in root.iterfind("link"):
        name = link.get("name")
        for kind in KINDS:
            yield from _take_apart(link, kind)
            for element in link.findall(kind):
                yield from _repair_geometry(element, f"link {name!r}: a {kind}")
                if reason := _why_nothing(element, kind, f"{urdf}, link {name!r}", urdf):
                    link.remove(element)
                    yield f"link {name!r}: a {kind} {reason}, left out"


def _take_apart(link: Element, kind: str) -> Iterator[str]:
    """Make elements of one shape each of one that has several."""
    for element in link.findall(kind):
        shapes = element.findall("geometry/*")
        if len(shapes) < 2 or any(shape.tag not in SIZES for shape in shapes):
            continue
        place = list(link).index(element)
        link.remove(element)
        for old in element.findall("geometry"):
            element.remove(old)
        for number, shape in enumerate(shapes):
            own = deepcopy(element)
            SubElement(own, "geometry").append(shape)
            link.insert(place + number, own)
        many = len(shapes)
        yield f"link {link.get('name')!r}: a {kind} of {many} shapes, taken as {many} {kind}s"


def _repair_geometry(element: Element, what: str) -> Iterator[str]:
    """Leave out what is no shape, and have a mesh scaled by three factors."""
    geometry = element.find("geometry")
    parts = [] if geometry is None else list(geometry)
    strange = [part for part in parts if part.tag not in SIZES]
    if geometry is not None and len(strange) == len(parts) - 1:
        for part in strange:
            geometry.remove(part)
            yield f"{what} has a <{part.tag}> beside its shape, left out"
    for mesh in element.iterfind("geometry/mesh"):
        factors = mesh.get("scale", "").split()
        if len(factors) == 1 or len(factors) == 4 and factors[3] in ("1", "1.0"):
            scale = " ".join((factors * 3)[:3])
            yield f"{what} has a mesh with scale={mesh.get('scale')!r}, taken as {scale!r}"
            mesh.set("scale", scale)


def _why_nothing(element: Element, kind: str, where: str, urdf: str) -> str:
    """Return why a ``<collision>`` or ``<visual>`` stands for nothing, or nothing if it may."""
    shapes = element.findall("geometry/*")
    if not shapes:
        return "without a shape"
    if len(shapes) > 1 or shapes[0].tag not in SIZES:
        return ""
    (shape,) = shapes
    if shape.tag == "mesh":
        return _why_no_mesh(shape, kind, where, urdf)
    try:
        sizes = sizes_of(shape, where)
    except AssetError:
        return ""
    least = SMALLEST_SIZE if kind == "collision" else 0.0
    if min(sizes) >= 0 and (min(sizes) < least or max(sizes) == 0):
        return f"of a {shape.tag} with {attributes_of(shape)}, which has no volume"
    return ""


def _why_no_mesh(mesh: Element, kind: str, where: str, urdf: str) -> str:
    file = mesh.get("filename", "")
    if not file.strip():
        return "of a mesh without a file"
    try:
        scale = numbers_of(mesh, "scale", (1.0, 1.0, 1.0), where)
        if 0.0 in scale:
            return f"of a mesh with {attributes_of(mesh)}, which has no volume"
        path = resolve(file, urdf, os.path.isfile)
        if kind == "visual" or not os.path.isfile(path) or has_body(path, scale, where, urdf):
            return ""
    except AssetError:
        return ""
    return f"of the mesh {file!r}, which has no volume"
