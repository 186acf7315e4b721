"""Meshes with fewer triangles in the place of a robot's own, for pictures that are drawn faster.

They are made once for each file, and kept beside the robot files.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sapien.render import RenderMaterial, RenderShapeTriangleMesh

from robot_layouts.core.files import read_json, read_regular
from robot_layouts.core.paths import default_root
from robot_layouts.kinematics.rotations import Floats
from robots import MissingPackageError
from robots.assets.assembled import write_folder
from robots.assets.store import say
from robots.urdf.mesh_files import MAX_MESH_BYTES

DEVIATION = 0.5e-3  # m
_FOLDER = "light_meshes"
_METHOD = 1  # to be raised when other meshes are made
_REMOVED = (0.995, 0.98, 0.95, 0.9, 0.8, 0.6)  # shares of triangles that may go
_FEW = 200  # triangles of a connected piece, which stays as it is
_WORTH = 0.8  # of a file's triangles; if more would be left, it is drawn as it is
_UNIT = 1e-3  # m; the decimation's thresholds are made for millimetres
_CREASE = np.cos(np.radians(35))  # between faces that are shaded as one smooth surface
_TOGETHER = 256  # points whose triangles are looked at at once, so few that they stay in the cache
_NEAREST = 30  # triangles that are looked at for each point; long ones lie side by side
_POINTS = (100, 20_000, 2e-6)  # of a surface: fewest, most, and the area of each (m²)
_PLACES = (1000, 60_000, 1e-6)  # by which the nearest triangles are found, likewise
TEXTURES = ("base_color", "normal", "emission", "transmission", "metallic", "roughness")
FINISH = ("base_color", "metallic", "roughness", "specular", "ior", "emission", "transmission")
_LARGEST_TABLE = 2**20  # bytes

Faces = NDArray[np.int64]  # (T, 3)
Surface = tuple[Floats, Faces]
"""Corners (m) and triangles."""


class LightPart(NamedTuple):
    """A part of a mesh file, of one material.

    Attributes:
        file: A mesh file that needs no scale.
        finish: Its material's values, by SAPIEN's names.
    """

    file: str
    finish: dict[str, Any]

    def material(self) -> RenderMaterial:
        """Return its material."""
        material = RenderMaterial()
        for name, value in self.finish.items():
            setattr(material, name, value)
        return material


def light_problem() -> str | None:
    """Say which packages are missing that make light meshes, or return None."""
    missing = [name for name in ("fast_simplification", "scipy") if find_spec(name) is None]
    return " and ".join(missing) or None


def light_parts(path: str, scale: Sequence[float]) -> tuple[LightPart, ...]:
    """Return the parts of a mesh file with fewer triangles, less than 1 mm from where they were.

    Args:
        path: The file.
        scale: Its factors along x, y and z.

    Returns:
        Empty if the file is to be drawn as it is: it has textures, or few triangles.

    Raises:
        MissingPackageError: If a package is missing, and they were not made before.
        AssetError: If the file cannot be read.
        UnwritableFileError: If the meshes cannot be written.
    """
    return _parts(path, os.stat(path).st_mtime_ns, tuple(scale))


@lru_cache(maxsize=1024)
def _parts(path: str, _modified: int, scale: tuple[float, ...]) -> tuple[LightPart, ...]:
    content = sha256(read_regular(Path(path), MAX_MESH_BYTES)).hexdigest()
    about = f"{_METHOD} {DEVIATION} {scale} {content}"
    folder = default_root() / _FOLDER / sha256(about.encode()).hexdigest()[:32]
    if not (folder / "parts.json").is_file():
        if problem := light_problem():
            raise MissingPackageError(
                f"light meshes need {problem}: pip install 'robot-layouts[light]'"
            )
        write_folder(folder, _made(path, np.array(scale)))
    finishes = read_json(folder / "parts.json", _LARGEST_TABLE)["parts"]
    return tuple(LightPart(str(folder / f"{i}.ply"), own) for i, own in enumerate(finishes))


def _made(path: str, scale: Floats) -> dict[str, bytes]:
    """Return the files of a mesh's light parts; their table is empty if it is to stay as it is."""
    say(f"making a lighter mesh of {Path(path).name} for pictures, once")
    shape: Any = RenderShapeTriangleMesh(path, [1.0, 1.0, 1.0], None)
    before = sum(len(part.triangles) for part in shape.parts)
    made = [] if _has_textures(shape) else [_light(part, scale) for part in shape.parts]
    kept: list[Any] = []
    files: dict[str, bytes] = {}
    if made and sum(len(faces) for _, faces in made) <= _WORTH * before:
        for i, (part, (corners, faces)) in enumerate(zip(shape.parts, made, strict=True)):
            files[f"{i}.ply"] = _ply(corners, faces)
            kept.append({name: getattr(part.material, name) for name in FINISH})
    about = {
        "file": Path(path).name,
        "fast-simplification": version("fast-simplification"),
        "triangles": [before, sum(len(faces) for _, faces in made)],
        "parts": kept,
    }
    return {**files, "parts.json": json.dumps(about, indent=1).encode()}


def _has_textures(shape: Any) -> bool:
    materials = [part.material for part in shape.parts]
    return any(getattr(m, f"{name}_texture") for m in materials for name in TEXTURES)


def _light(part: Any, scale: Floats) -> Surface:
    """Return corners (m) and triangles of a part, its connected pieces one after the other."""
    own = np.asarray(part.vertices, np.float64) * scale
    corners, place = np.unique(own, axis=0, return_inverse=True)
    faces = place.reshape(-1)[np.asarray(part.triangles, np.int64)]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    if scale.prod() < 0:
        faces = faces[:, ::-1]
    made = [_decimated(piece) for piece in _pieces(corners, faces)]
    starts = np.cumsum([0, *(len(piece) for piece, _ in made)])
    joined = [own + start for (_, own), start in zip(made, starts[:-1], strict=True)]
    empty = np.zeros((0, 3))
    return np.concatenate([empty, *(piece for piece, _ in made)]), np.concatenate(
        [empty.astype(np.int64), *joined]
    )


def _pieces(corners: Floats, faces: Faces) -> Iterator[Surface]:
    """Yield what is connected, each with corners of its own."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = faces.reshape(-1), np.roll(faces, 1, axis=1).reshape(-1)
    edges = coo_array((np.ones(len(one), bool), (one, other)), shape=(len(corners),) * 2)
    _, label = connected_components(edges, directed=False)
    of_face = label[faces[:, 0]]
    order = np.argsort(of_face, kind="stable")
    for rows in np.split(faces[order], np.flatnonzero(np.diff(of_face[order])) + 1):
        used, place = np.unique(rows, return_inverse=True)
        yield corners[used], place.reshape(-1, 3)


def _decimated(whole: Surface) -> Surface:
    """Return a piece with fewer triangles, all of it within `DEVIATION` of where it was."""
    from fast_simplification import simplify

    corners, faces = whole
    if len(faces) <= _FEW:
        return whole
    scaled, numbers = corners / _UNIT, faces.astype(np.int32)
    best = whole
    for share in _REMOVED:
        found: Any = simplify(scaled, numbers, share)
        lighter = found[0].astype(np.float64) * _UNIT, found[1].astype(np.int64)
        if len(lighter[1]) >= len(best[1]):
            break
        corrected = _corrected(lighter, whole)
        if len(corrected[1]) < len(best[1]):
            best = corrected
    return best


def _corrected(lighter: Surface, whole: Surface) -> Surface:
    """Return a lighter surface with what is too far from the whole one replaced by that."""
    if not len(lighter[1]):
        return whole
    right = _away(lighter, whole) <= DEVIATION
    lost = whole[1][_away(whole, lighter, right) > DEVIATION]
    faces = np.concatenate([lighter[1][right], lost + len(lighter[0])])
    return np.concatenate([lighter[0], whole[0]]), faces


def _away(surface: Surface, other: Surface, right: NDArray[np.bool_] | None = None) -> Floats:
    """Return how far each triangle of a surface is from another surface, (T,) (m).

    That of its corners, its middle, and of points on it; of each, the distance is that to the
    nearest of some triangles, so that it is never taken for too small. Infinity if no triangle
    near its middle faces the same way, as it is drawn from one side only.

    Args:
        surface: The surface.
        other: The other one.
        right: Which triangles of the other one count, (T,); nearest to another one is infinity.
    """
    import trimesh
    from scipy.spatial import KDTree

    own, mesh = (trimesh.Trimesh(*each, process=False) for each in (surface, other))
    between, on = _sampled(own, _POINTS)
    points = np.concatenate([own.triangles_center, between, surface[0]])
    places, triangle = _sampled(mesh, _PLACES)
    places = np.concatenate([places, mesh.triangles_center])
    triangle = np.concatenate([triangle, np.arange(len(mesh.faces))])
    near: Any = KDTree(places).query(points, _NEAREST)[1]
    near = triangle[np.minimum(near, len(triangle) - 1)]
    gaps = np.empty(near.shape)
    for start in range(0, len(points), _TOGETHER):
        block = slice(start, start + _TOGETHER)
        corners = mesh.triangles[near[block]].reshape(-1, 3, 3)
        repeated = points[block].repeat(_NEAREST, axis=0)
        closest: Any = trimesh.triangles.closest_point(corners, repeated)
        gaps[block] = np.linalg.norm(closest - repeated, axis=1).reshape(-1, _NEAREST)
    nearest, count = gaps.min(1), len(surface[1])
    if right is not None:
        nearest[~right[near[np.arange(len(gaps)), gaps.argmin(1)]]] = np.inf
    away = np.maximum(nearest[:count], nearest[count + len(between) :][surface[1]].max(1))
    np.maximum.at(away, on, nearest[count : count + len(between)])
    across = np.cross(*_sides(surface)), np.cross(*_sides(other))
    alike = (across[0][:, None] * across[1][near[:count]]).sum(2) >= 0
    away[~(alike & (gaps[:count] <= DEVIATION)).any(1)] = np.inf
    return away


def _sides(surface: Surface) -> tuple[Floats, Floats]:
    """Return two sides of each triangle, which are across its normal."""
    first, second, third = np.moveaxis(surface[0][surface[1]], 1, 0)
    return second - first, third - first


def _sampled(mesh: Any, limits: tuple[int, int, float]) -> tuple[Floats, NDArray[np.int64]]:
    """Return points on a mesh, (P, 3), and of each on which triangle it is, (P,)."""
    import trimesh

    fewest, most, area = limits
    count = int(np.clip(mesh.area / area, fewest, most))
    found: Any = trimesh.sample.sample_surface(mesh, count, seed=0)
    return found[0], found[1]


def _ply(corners: Floats, faces: Faces) -> bytes:
    """Return a mesh as a file, with normals: smooth but where faces meet at an edge."""
    import trimesh

    across = np.cross(*_sides((corners, faces)))
    length = np.linalg.norm(across, axis=1, keepdims=True)
    upright = across / np.where(length > 0, length, 1)
    first, second = _sharing(faces.reshape(-1))
    face, beside = first // 3, second // 3
    alike = (upright[face] * upright[beside]).sum(1) > _CREASE
    normals = np.zeros((faces.size, 3))
    np.add.at(normals, first[alike], across[beside[alike]])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 0, normals / np.where(size > 0, size, 1), [[0.0, 0.0, 1.0]])
    rows = np.column_stack([faces.reshape(-1), np.round(normals * 500)])
    _, kept, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    mesh = trimesh.Trimesh(
        corners[faces.reshape(-1)[kept]],
        place.reshape(-1, 3),
        vertex_normals=normals[kept],
        process=False,
    )
    contents: Any = mesh.export(file_type="ply", vertex_normal=True)
    return contents


def _sharing(corner: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return all pairs of places at which the same corner stands, each with itself, too."""
    order = np.argsort(corner, kind="stable")
    count = np.bincount(corner)
    start = np.cumsum(count) - count
    many = count[corner[order]]  # of each place, in that order
    first = np.repeat(order, many)
    within = np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    second = order[np.repeat(start[corner[order]], many) + within]
    return first, second
