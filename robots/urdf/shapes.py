"""What the links of a URDF collide with and look like: its shapes, refused in clear words."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError
from robots.urdf.numbers import LARGEST_LENGTH, Vector3, numbers_of, required_numbers, shown

SMALLEST_SIZE = 1e-5  # m; PhysX's own tolerances are larger

# Attributes of each kind of shape, with how many numbers each has.
SIZES: Mapping[str, Mapping[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {},
}


@dataclass(frozen=True)
class UrdfShape:
    """A shape of a link.

    Attributes:
        kind: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``.
        sizes: Of a box its extents, of a sphere its radius, of a cylinder and a capsule radius
            and length (m); of a mesh the scale along x, y and z.
        file: Of a mesh what the URDF refers to, else empty.
        xyz: Where it is in the link's frame (m).
        rpy: How it is turned there, fixed-axis roll, pitch, yaw (rad).
        where: The URDF and the link, for messages.
    """

    kind: str
    sizes: tuple[float, ...]
    file: str
    xyz: Vector3
    rpy: Vector3
    where: str


def read_shape(element: Element, where: str) -> UrdfShape:
    """Return the shape of a ``<collision>`` or ``<visual>``.

    Args:
        element: The element.
        where: The URDF and the link, for messages.

    Raises:
        AssetError: If it has no shape, several, or one of an unknown kind, or a size is missing,
            no number, not positive or beyond all measure.
    """
    what = f"a {element.tag}"
    geometry = element.find("geometry")
    shapes = [] if geometry is None else list(geometry)
    if not shapes:
        raise AssetError(f"{where}: {what} without a shape; choices: {', '.join(SIZES)}")
    if len(shapes) > 1:
        raise AssetError(
            f"{where}: {what} with {len(shapes)} shapes ({', '.join(s.tag for s in shapes)}); each"
            f" needs a {what.removeprefix('a ')} of its own"
        )
    (shape,) = shapes
    if shape.tag not in SIZES:
        raise AssetError(
            f"{where}: {what} of shape {shown(shape.tag)}; choices: {', '.join(SIZES)}"
        )
    origin = element.find("origin")
    xyz, rpy = (numbers_of(origin, key, (0.0, 0.0, 0.0), where) for key in ("xyz", "rpy"))
    return UrdfShape(
        kind=shape.tag,
        sizes=_scale(shape, where) if shape.tag == "mesh" else _sizes(shape, what, where),
        file=_file(shape, where) if shape.tag == "mesh" else "",
        xyz=xyz,
        rpy=rpy,
        where=where,
    )


def _sizes(shape: Element, what: str, where: str) -> tuple[float, ...]:
    found: list[float] = []
    for attribute, count in SIZES[shape.tag].items():
        found += required_numbers(shape, attribute, count, where, LARGEST_LENGTH)
    if what == "a collision" and min(found) < SMALLEST_SIZE:
        raise AssetError(
            f"{where}: a collision shape without a volume: a {shape.tag} with {_listing(shape)};"
            f" sizes are {SMALLEST_SIZE:g} m and more"
        )
    if min(found) < 0:
        raise AssetError(f"{where}: {what} of a {shape.tag} with {_listing(shape)}, below 0")
    return tuple(found)


def _scale(mesh: Element, where: str) -> tuple[float, ...]:
    scale = numbers_of(mesh, "scale", (1.0, 1.0, 1.0), where)
    if 0.0 in scale:
        raise AssetError(f"{where}: a mesh with {_listing(mesh)} has no volume; leave no factor 0")
    return scale


def _file(mesh: Element, where: str) -> str:
    file = mesh.get("filename", "")
    if not file.strip() or posixpath.basename(file) == "":
        raise AssetError(f"{where}: a mesh with filename={file!r}; it takes the path of a file")
    return file


def _listing(shape: Element) -> str:
    return " ".join(f"{key}={value!r}" for key, value in shape.items())
