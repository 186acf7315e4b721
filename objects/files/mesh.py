"""Makes a thing of a mesh file: convex parts that collide, ways to rest, places to grasp."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from objects.descriptor import ObjectDescriptor
from objects.family import Made
from objects.files.convex import MOST_PARTS, convex_parts, hull_volume
from objects.files.grasps import MANY, MOST, proposed
from objects.files.remembering import Files, remembered
from objects.files.rests import resting
from objects.shapes import GREY, Color, ConvexHull, Friction, Mesh, Place, Shape
from objects.solids import has_volume, mass_of
from robot_layouts.core.bounds import checked_choice, checked_number, checked_whole
from robot_layouts.core.errors import AssetError, DescriptorError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robot_layouts.core.paths import absolute
from robot_layouts.kinematics.rotations import Floats, rotate
from robots.descriptor import IDENTITY, Quaternion
from robots.urdf.mesh_files import MAX_MESH_BYTES, load_scene

UNKNOWN = "NOASSERTION"  # SPDX's word for a licence that is not known
LARGEST = 5.0  # m; what is longer is of other units
_Y_UP = (".glb", ".gltf")  # as glTF 2.0 has it
_TURNS: dict[str, Quaternion] = {  # from the file's frame to one whose z axis points up
    "x": (0.7071067811865476, 0.0, -0.7071067811865476, 0.0),
    "y": (0.7071067811865476, 0.7071067811865476, 0.0, 0.0),
    "z": IDENTITY,
}
_WATER = 1000.0  # kg/m³
_SURFACE_PARTS = 128  # that stand for a surface
_FEW = 20  # grasps; where there are fewer, more places are tried


def thing_from_mesh(
    path: str | os.PathLike[str],
    name: str | None = None,
    *,
    scale: float = 1.0,
    up: str | None = None,
    mass: float | None = None,
    density: float = _WATER,
    friction: Friction | None = None,
    color: Color | None = None,
    most_parts: int = MOST_PARTS,
    most_grasps: int = MOST,
    **fields: Any,
) -> ObjectDescriptor:
    """Return a thing that looks as a mesh file says; see `objects.descriptor.ThingFromMesh`."""
    file = absolute(path, "the mesh")
    axis = _usual_up(file) if up is None else up
    checked_choice("up", axis, tuple(_TURNS), DescriptorError)
    factor = checked_number("scale", scale, 1e-6, 1e6, DescriptorError)
    most = checked_whole("most_parts", most_parts, 1, 256, DescriptorError)
    dense = checked_number("density", density, 1e-3, 1e6, DescriptorError, "kg/m³")
    heavy = None if mass is None else checked_number("mass", mass, 1e-6, 1e4, DescriptorError, "kg")
    grasps = checked_whole("most_grasps", most_grasps, 1, 1000, DescriptorError)
    options = file.name, factor, axis, most, grasps
    made = remembered(_contents(file), options, file.parent, lambda: _made(file, options))
    ratio = dense / _WATER if heavy is None else heavy / mass_of(made.parts).mass
    looks = {"friction": friction, "color": color or GREY}
    given: dict[str, Any] = {
        "name": name or identifier(file.stem),
        "about": f"A thing from {file.name}",
        "parts": tuple(_finished(part, ratio, looks, textured=not color) for part in made.parts),
        "rests": made.rests,
        "grasps": tuple(made.grasps),
        "source": file.name,
        "licence": UNKNOWN,
    }
    return ObjectDescriptor(**{**given, **fields})


def convex_hulls(path: str, scale: Place) -> list[Floats]:
    """Return the corners, (n, 3) each (m), of convex parts that fill what a mesh file's surface is.

    They are found once, and kept in the local copy.

    Args:
        path: The file.
        scale: Factors along x, y and z.

    Raises:
        AssetError: If it cannot be read as a mesh, or is empty.
        DescriptorError: If it has no volume.
        MissingPackageError: If it is hollow and the package coacd is not installed.
    """
    file = Path(path)

    def made() -> tuple[Made, Files]:
        mesh = _mesh(file)
        solid = [p for p in mesh.split(only_watertight=False) if has_volume(np.array(p.vertices))]
        parts = [
            ConvexHull(corners)
            for piece in solid or [mesh]
            for corners in convex_parts(piece, _SURFACE_PARTS, path, fine=True)
        ]
        return Made(parts), {}

    hulls = remembered(_contents(file), ("surface", _SURFACE_PARTS), None, made).parts
    return [np.array(hull.corners) * scale for hull in hulls if isinstance(hull, ConvexHull)]


def _finished(part: Shape, ratio: float, looks: dict[str, Any], *, textured: bool) -> Shape:
    if isinstance(part, Mesh):
        return replace(part, textured=textured, **looks)
    return replace(part, density=part.density * ratio, **looks)


def _made(file: Path, options: tuple[str, float, str, int, int]) -> tuple[Made, Files]:
    _, scale, up, most, asked = options
    mesh = _mesh(file)
    turn = _TURNS[up]
    mesh.vertices = rotate(np.array(turn), np.asarray(mesh.vertices, float) * scale)
    longest = float(np.ptp(mesh.vertices, axis=0).max())
    if longest > LARGEST:
        raise DescriptorError(
            f"{file} is {longest:.3g} m long; things are {LARGEST:g} m long at most (are its"
            " lengths in millimetres? then scale=0.001)"
        )
    parts = convex_parts(mesh, most, str(file))
    volume = sum(hull_volume(np.array(corners)) for corners in parts)
    true = float(mesh.volume) if mesh.is_watertight and mesh.volume > 0 else volume
    hulls = [
        ConvexHull(corners, density=_WATER * true / volume, visible=False) for corners in parts
    ]
    drawn = Mesh(
        file.name, scale=(scale, scale, scale), quaternion=turn, textured=True, collides=False
    )
    centre = mass_of(hulls).centre
    rests = resting([corner for corners in parts for corner in corners], centre)
    lying = next(iter(rests.values()))
    grasps = proposed(hulls, hulls, centre, lying, most=asked)
    if len(grasps) < _FEW:
        grasps = proposed(hulls, hulls, centre, lying, most=asked, points=MANY)
    if not grasps:
        grasps = proposed(hulls, hulls, centre, lying, most=asked, points=MANY, slanted=True)
    return Made([drawn, *hulls], grasps, rests=rests), {}


def _mesh(file: Path) -> Any:
    """Return a file's mesh, with corners that its faces share."""
    mesh = load_scene(file.as_posix(), str(file), process=False).to_mesh()
    if len(mesh.faces) == 0:
        raise AssetError(f"the mesh {file} is empty, or damaged")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def _contents(file: Path) -> bytes:
    """Return what a file's shape depends on; the buffers of a glTF lie elsewhere."""
    if file.suffix.lower() == ".gltf":
        mesh = _mesh(file)
        return bytes(mesh.vertices.tobytes() + mesh.faces.tobytes())
    try:
        return read_regular(file, MAX_MESH_BYTES)
    except UnreadableFileError as error:
        raise AssetError(f"cannot read the mesh {file}: {error.strerror}") from error


def _usual_up(file: Path) -> str:
    return "y" if file.suffix.lower() in _Y_UP else "z"


def identifier(text: str) -> str:
    """Return a name that things and their points can have, made of any text."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")
    return name if name[:1].isalpha() else f"thing_{name}"
