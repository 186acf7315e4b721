"""What the links of a URDF collide with and look like: its shapes, refused in clear words."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError
from robots.urdf.numbers import (
    LARGEST_LENGTH,
    expect_numbers,
    numbers_of,
    required_numbers,
    shown,
)

if TYPE_CHECKING:
    from kinematics.rotations import Floats

SMALLEST_SIZE = 1e-5  # m; PhysX's own tolerances are larger

# Attributes of each kind of shape, with how many numbers each has.
SIZES: Mapping[str, Mapping[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {},
}
ORIGIN: Mapping[str, Mapping[str, int]] = {"origin": {"xyz": 3, "rpy": 3}}


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A shape of a link.

    Attributes:
        kind: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``.
        sizes: Of a box its extents, of a sphere its radius, of a cylinder and a capsule radius
            and length (m); of a mesh the scale along x, y and z.
        file: Of a mesh what the URDF refers to, else empty.
        origin: Its pose in the link's frame, (4, 4) (m).
        where: The URDF and the link, for messages.
    """

    kind: str
    sizes: tuple[float, ...]
    file: str
    origin: Floats
    where: str


def expect_shape(element: Element, where: str) -> None:
    """Refuse a ``<collision>`` or ``<visual>`` that is no shape.

    Args:
        element: The element.
        where: The URDF and the link, for messages.

    Raises:
        AssetError: If it has no shape, several, or one of an unknown kind, or a size is missing,
            no number, not positive or beyond all measure.
    """
    what = f"a {element.tag}"
    shapes = element.findall("geometry/*")
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
    expect_numbers(element, ORIGIN, where)
    if shape.tag == "mesh":
        _expect_mesh(shape, where)
    else:
        _expect_sizes(shape, what, where)


def _expect_sizes(shape: Element, what: str, where: str) -> None:
    sizes: list[float] = []
    for attribute, count in SIZES[shape.tag].items():
        sizes += required_numbers(shape, attribute, count, where, LARGEST_LENGTH)
    if what == "a collision" and min(sizes) < SMALLEST_SIZE:
        raise AssetError(
            f"{where}: a collision shape without a volume: a {shape.tag} with {_listing(shape)};"
            f" sizes are {SMALLEST_SIZE:g} m and more"
        )
    if min(sizes) < 0:
        raise AssetError(f"{where}: {what} of a {shape.tag} with {_listing(shape)}, below 0")


def _expect_mesh(mesh: Element, where: str) -> None:
    if 0.0 in numbers_of(mesh, "scale", (1.0, 1.0, 1.0), where):
        raise AssetError(f"{where}: a mesh with {_listing(mesh)} has no volume; leave no factor 0")
    file = mesh.get("filename", "")
    if not file.strip() or posixpath.basename(file) == "":
        raise AssetError(f"{where}: a mesh with filename={file!r}; it takes the path of a file")


def _listing(shape: Element) -> str:
    return " ".join(f"{key}={value!r}" for key, value in shape.items())
