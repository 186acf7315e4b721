"""Makes a thing of a mesh file: convex parts that collide, ways to rest, places to grasp.

What was made of a file is kept in the local copy: the next process only reads it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from objects.descriptor import Grasp, NamedPoint, ObjectDescriptor
from objects.family import Made
from objects.files.convex import MOST_PARTS, convex_parts, hull_of, hull_volume
from objects.files.grasps import POINTS, proposed
from objects.joints import Joint
from objects.shapes import GREY, SIZED, Color, ConvexHull, Finish, Friction, Mesh, Place, Shape
from objects.solids import mass_of, rounded_turn
from robot_layouts.core.bounds import checked_choice, checked_number, checked_whole
from robot_layouts.core.errors import AssetError, DescriptorError, UnreadableFileError
from robot_layouts.core.files import read_regular, read_text
from robot_layouts.core.paths import absolute, default_root
from robot_layouts.kinematics.rotations import Floats, quaternion_about, rotate
from robots.assets.assembled import write_folder
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
_FEW, _MANY = 20, 8  # grasps, and how many times as many places are tried where there are fewer
_VERSION = 2  # of what is made of files; another one makes them anew
_FOLDER, _THING = "objects", "object.json"
_LARGEST = 1 << 26  # bytes of what is kept
_KINDS = {kind.__name__: kind for kind in SIZED}

Files = Mapping[str, bytes]
"""Contents by name, which the shapes of a thing refer to."""


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
    options = file.name, factor, axis, most
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


def _finished(part: Shape, ratio: float, looks: dict[str, Any], *, textured: bool) -> Shape:
    if isinstance(part, Mesh):
        return replace(part, textured=textured, **looks)
    return replace(part, density=part.density * ratio, **looks)


def _made(file: Path, options: tuple[str, float, str, int]) -> tuple[Made, Files]:
    _, scale, up, most = options
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
    grasps = proposed(hulls, hulls, centre, lying)
    if len(grasps) < _FEW:
        grasps = proposed(hulls, hulls, centre, lying, points=_MANY * POINTS)
    if not grasps:
        grasps = proposed(hulls, hulls, centre, lying, points=_MANY * POINTS, slanted=True)
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


UPRIGHT = "upright"
STEADY = np.radians(8)  # by which it can be tilted before it topples, at least
_TOUCHES = 3e-5  # m; what is this near to the table carries it
_ALIKE = np.cos(np.radians(15))  # between the undersides of two rests
_AS_MADE = np.cos(np.radians(10))  # between what is upright and the file's own z axis
_MOST = 4
_LEVEL = 1e-9


class _Side(NamedTuple):
    """A side that a thing can lie on.

    Attributes:
        down: Which way is down then, in its own frame, (3,).
        steady: By how much it can be tilted before it topples (rad).
    """

    down: Floats
    steady: float


def resting(corners: Sequence[Place] | Floats, centre: Place | Floats) -> Mapping[str, Quaternion]:
    """Return how a thing can lie on a table, as `ObjectDescriptor.rests` has it.

    If it stands as its file has it, that is ``"upright"`` and comes first; the others are
    ``"side_1"`` and so on, the steadiest first. What is nowhere steady has its steadiest side.

    Args:
        corners: Of all that collides of it (m).
        centre: Its centre of mass (m).
    """
    points, middle = np.array(corners), np.array(centre)
    sides = sorted(_sides(points, middle), key=lambda side: -side.steady)
    chosen = list[_Side]()
    for side in sides:
        if (side.steady >= STEADY or not chosen) and all(
            side.down @ one.down < _ALIKE for one in chosen
        ):
            chosen.append(side)
    as_made = [side for side in chosen if -side.down[2] >= _AS_MADE][:1]
    others = [side for side in chosen if -side.down[2] < _AS_MADE][:_MOST]
    names = [UPRIGHT] * len(as_made) + [f"side_{i + 1}" for i in range(len(others))]
    return {name: _turned(side.down) for name, side in zip(names, as_made + others, strict=True)}


def _sides(points: Floats, centre: Floats) -> Iterator[_Side]:
    normals = hull_of(points).equations[:, :3]
    for i in np.unique(np.round(normals, 3), axis=0, return_index=True)[1]:
        way = normals[i]
        heights = points @ way
        carrying = points[heights > heights.max() - _TOUCHES]
        inside = _margin(carrying, centre, way)
        if inside > 0:
            yield _Side(way, float(np.arctan2(inside, heights.max() - centre @ way)))


def _margin(carrying: Floats, centre: Floats, down: Floats) -> float:
    """Return how far inside the edge of what carries it a centre of mass is (m)."""
    along = np.eye(3)[int(np.abs(down).argmin())]
    one = np.asarray(np.cross(down, along), float)
    other = np.asarray(np.cross(down, one), float)
    flat = (carrying - centre) @ np.stack([one, other], axis=1) / np.linalg.norm(one)
    edge = hull_of(flat)
    return -1.0 if edge is None else float(-edge.equations[:, 2].max())


def _turned(down: Floats) -> Quaternion:
    """Return the least turn that makes a way of the thing point down, wxyz."""
    x, y, z = down.tolist()
    aside = float(np.hypot(x, y))
    axis = (-y / aside, x / aside, 0.0) if aside > _LEVEL else (1.0, 0.0, 0.0)
    return rounded_turn(quaternion_about(axis, np.arctan2(aside, -z)))


def remembered(
    contents: bytes, options: object, folder: Path | None, make: Callable[[], tuple[Made, Files]]
) -> Made:
    """Return what is made of a file; it is made once, and then read from the local copy.

    Args:
        contents: Of the file.
        options: How it is to be made, as something whose text says all.
        folder: Where the files are that its shapes name; None for those that `make` gives.
        make: Makes it, with files that belong to it.

    Raises:
        AssetError: If what the local copy has of it is damaged.
        UnwritableFileError: If it cannot be written.
    """
    text = f"{_VERSION} {sha256(contents).hexdigest()} {options!r}"
    place = default_root() / _FOLDER / sha256(text.encode()).hexdigest()[:20]
    kept = place / _THING
    if not kept.is_file():
        made, files = make()
        write_folder(place, {**files, _THING: json.dumps(_plain(made)).encode()})
    try:
        return _thing_of(json.loads(read_text(kept, _LARGEST)), folder or place)
    except (ValueError, KeyError, TypeError) as error:
        raise AssetError(f"{kept} is damaged ({error}); delete the folder that it is in") from error


def _plain(made: Made) -> dict[str, Any]:
    return {
        "parts": [_plain_shape(part) for part in made.parts],
        "joints": [
            {**vars(joint), "parts": [_plain_shape(part) for part in joint.parts]}
            for joint in made.joints
        ],
        "rests": dict(made.rests),
        "points": {name: asdict(point) for name, point in made.points.items()},
        "grasps": [list(vars(grasp).values()) for grasp in made.grasps],
    }


def _plain_shape(shape: Shape) -> dict[str, Any]:
    usual = {field.name: field.default for field in fields(shape)}
    given = {name: value for name, value in vars(shape).items() if value != usual[name]}
    for name in ("friction", "finish"):
        if name in given:
            given[name] = asdict(given[name])
    return {"kind": type(shape).__name__, **given}


def _thing_of(plain: dict[str, Any], folder: Path) -> Made:
    return Made(
        parts=[_shape(part, folder) for part in plain["parts"]],
        joints=[_joint(joint, folder) for joint in plain["joints"]],
        rests={name: tuple(turn) for name, turn in plain["rests"].items()},
        points={name: NamedPoint(**point) for name, point in plain["points"].items()},
        grasps=[Grasp(*grasp) for grasp in plain["grasps"]],
    )


def _joint(plain: dict[str, Any], folder: Path) -> Joint:
    given: dict[str, Any] = {**plain, "parts": tuple(_shape(p, folder) for p in plain["parts"])}
    return Joint(**given)


def _shape(plain: dict[str, Any], folder: Path) -> Shape:
    given = dict(plain)
    kind = _KINDS[given.pop("kind")]
    for name, made_of in (("friction", Friction), ("finish", Finish)):
        if name in given:
            given[name] = made_of(**given[name])
    shape = kind(**given)
    return replace(shape, file=folder / shape.file) if isinstance(shape, Mesh) else shape
