"""Repairs links of a URDF: shapes in elements of their own, and inertias that a body can have."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement

from robot_layouts.core.errors import AssetError
from robots.urdf.checks import (
    MOMENTS,
    PRODUCTS,
    SMALLEST,
    SMALLEST_SIZE,
    attributes_of,
    inertia_problems,
    link_of,
    moved_links,
    sizes_of,
)
from robots.urdf.mesh_files import has_body, read_corners
from robots.urdf.model import SIZES
from robots.urdf.paths import resolve
from robots.urdf.text import numbers_of

if TYPE_CHECKING:
    from robot_layouts.kinematics.rotations import Floats

KINDS = ("visual", "collision")
DENSITY = 1000.0  # kg/m³; what SAPIEN takes for collision shapes
ZONE = "safety"
COARSE = "_sc"  # in Franka's files: shapes against which a planner checks an arm with itself
THINNEST = 1e-3  # m; of a body whose shapes are thinner

Size = tuple[float, float, float]


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


def drop_zones(root: Element, _: str) -> Iterator[str]:
    """Leave out the shapes of safety zones, which are to keep things out, and yield of which links.

    Around a hand they would keep out what it is to grasp. They are links for which nothing is
    drawn and which are called so, or as the link that they are fixed to, with `COARSE` behind, if
    that has shapes of its own.

    Args:
        root: The ``<robot>``.
    """
    solid = {link.get("name") for link in root.findall("link[collision]")}
    fixed = (joint for joint in root.iterfind("joint") if joint.get("type") == "fixed")
    carriers = {link_of(joint, "child"): link_of(joint, "parent") for joint in fixed}
    for link in root.iterfind("link"):
        name, shapes = link.get("name") or "", link.findall("collision")
        if not shapes or link.find("visual") is not None:
            continue
        if ZONE in name.lower():
            reason = "as it is a safety zone and not a body"
        elif (own := carriers.get(name)) in solid and name == f"{own}{COARSE}":
            reason = f"as {own!r} has shapes that are finer"
        else:
            continue
        for shape in shapes:
            link.remove(shape)
        yield f"link {name!r}: its shape left out, {reason}"


def fill_ends(root: Element, urdf: str) -> Iterator[str]:
    """Have the end of an arm collide as it looks, if the arm does and its end does not.

    That is its last body, or the last two, as a single jaw closes on what carries it. A joint
    without limits ends in a wheel or a flange, which is left as it is. The hand that carries the
    end collides as it looks, too, if some of its shapes stand for fingers, wherever these are:
    inside them nothing could be grasped.

    Args:
        root: The ``<robot>``.
        urdf: Its path, by which it refers to meshes.
    """
    links = {link.get("name", ""): link for link in root.iterfind("link")}
    moving = {link_of(j, "child"): j for j in root.iterfind("joint") if j.get("type") != "fixed"}
    first = _first_rigid(root)
    solid = {first[name] for name, link in links.items() if link.find("collision") is not None}
    carriers = {end: first.get(link_of(joint, "parent"), "") for end, joint in moving.items()}
    carrying, found = {*carriers.values()}, set[str]()
    for end, carrier in carriers.items():
        bare = [end] if carrier in solid else [end, carrier]
        last = end not in carrying and moving[end].get("type") != "continuous"
        if last and end not in solid and carriers.get(bare[-1]) in solid:
            found |= {*bare}
    hands = {link_of(joint, "parent") for end, joint in moving.items() if end in found}
    for name, link in links.items():
        drawn = [] if first[name] not in found and name not in hands else link.findall("visual")
        shapes = [shape for shape in drawn if _is_solid(shape, f"{urdf}, link {name!r}", urdf)]
        if not shapes:
            continue
        if first[name] in found:
            yield f"link {name!r} ends what collides, and has no collision: it collides as it looks"
        elif len(shapes) == len(drawn) and _stands_for_more(link, f"{urdf}, link {name!r}", urdf):
            for old in link.findall("collision"):
                link.remove(old)
            yield f"link {name!r}: shapes that stand for its fingers, too: it collides as it looks"
        else:
            continue
        for shape in shapes:
            parts = (part for part in shape if part.tag in ("origin", "geometry"))
            SubElement(link, "collision").extend(map(deepcopy, parts))


def _stands_for_more(link: Element, where: str, urdf: str) -> bool:
    """Tell whether the middle of some shape of a link lies where nothing of it is drawn."""
    import numpy as np

    drawn, solid = (
        [
            made
            for shape in link.iterfind(kind)
            if (made := _corners(shape, where, urdf)) is not None
        ]
        for kind in KINDS
    )
    points = np.concatenate(drawn)
    low, high = points.min(axis=0), points.max(axis=0)
    middles = [(corners.min(axis=0) + corners.max(axis=0)) / 2 for corners in solid]
    return any(((middle < low) | (middle > high)).any() for middle in middles)


def _first_rigid(root: Element) -> dict[str, str]:
    """Return for each link the first one that is rigid with it, seen from the root."""
    names = dict.fromkeys(link.get("name", "") for link in root.iterfind("link"))
    fixed = (joint for joint in root.iterfind("joint") if joint.get("type") == "fixed")
    above = {link_of(joint, "child"): link_of(joint, "parent") for joint in fixed}
    first: dict[str, str] = {}
    for name in names:
        way, last, up = dict[str, None](), name, name
        while up in names and up not in way and up not in first:
            way[up] = None
            last, up = up, above.get(up, "")
        if way:
            first |= dict.fromkeys(way, first.get(up, last))
    return first


def _is_solid(visual: Element, where: str, urdf: str) -> bool:
    """Tell whether a ``<visual>`` can be collided with: its file is there, and has a volume."""
    shapes = visual.findall("geometry/*")
    if len(shapes) != 1 or _why_nothing(visual, "collision", where, urdf):
        return False
    return shapes[0].tag != "mesh" or _corners(visual, where, urdf) is not None


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


def repair_inertia(root: Element, urdf: str) -> Iterator[str]:
    """Replace what no body has by what mass and size of the link give, and yield what was done.

    Args:
        root: The ``<robot>``.
        urdf: Its path, by which it refers to meshes.
    """
    moved = moved_links(root)
    for link in root.iterfind("link"):
        where = f"{urdf}: link {link.get('name', '')!r}"
        if not _is_possible(link, where, moves=link.get("name") in moved):
            with suppress(AssetError):  # text that is no number is refused later
                yield from _repair(link, where, urdf)


def _is_possible(link: Element, where: str, *, moves: bool) -> bool:
    try:
        return not any(inertia_problems(link, where, moves=moves))
    except AssetError:
        return False


def _repair(link: Element, where: str, urdf: str) -> Iterator[str]:
    name, inertial = link.get("name"), next(link.iterfind("inertial"))
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    (weight,) = numbers_of(mass, "value", (0.0,), where)
    numbers = [numbers_of(tensor, key, (0.0,), where)[0] for key in (*MOMENTS, *PRODUCTS)]
    if weight < 0 or 0 < weight < SMALLEST:
        return
    if tensor is not None and (missing := [key for key in PRODUCTS if tensor.get(key) is None]):
        tensor.attrib.update(dict.fromkeys(missing, "0"))
        if _is_possible(link, where, moves=True):
            yield f"link {name!r} has an inertia without {', '.join(missing)}, taken as 0"
            return
    size = _size(link, where, urdf)
    if weight == 0 and link.find("collision") is not None:
        link.remove(inertial)
        yield (
            f"link {name!r} has no mass: mass and inertia follow from its collision shapes and"
            f" {DENSITY:g} kg/m³"
        )
    elif weight == 0 and size is None:
        link.remove(inertial)
        yield f"link {name!r} has no mass, so its <inertial> was left out"
    else:
        problem = "no inertia"
        if any(numbers):
            listing = ", ".join(f"{number:g}" for number in numbers)
            problem = f"the inertia {listing} kg·m² (xx, yy, zz, xy, xz, yz), which no body has"
        if not weight:
            problem = f"no mass: took {DENSITY:g} kg/m³; and {problem}"
            weight = DENSITY * math.prod(size or (0.0,))
        _set_box(inertial, weight, size or _ball(weight))
        yield f"link {name!r} has {problem}: took that of {_in_words(weight, size)}"


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

    if any(shape.tag not in SIZES for shape in element.iterfind("geometry/*")):
        return None  # which is refused, or left out, when shapes are read
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
