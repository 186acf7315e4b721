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

DEVIATION = 0.75e-3  # m
_FOLDER = "light_meshes"
_METHOD = 3  # to be raised when other meshes are made
_REMOVED = (0.6, 0.8, 0.9, 0.95, 0.98, 0.995)  # shares of triangles that may go
_GAIN = 0.97  # of a piece's triangles; if fewer removed leave more than that, no more are tried
_OPENING = 1e-3  # m, of a cell: what is two of them wide may show what is behind it
_MOST_CELLS = 2**25  # in which hidden triangles are looked for
_MOST_POINTS = 2**23  # of surfaces, by which the cells are found that they cross
_IN_CELL = 20  # points for each cell that a surface crosses: so many that none is left without
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
    own = [] if _has_textures(shape) else [_welded(part, scale) for part in shape.parts]
    whole = all(np.isfinite(corners).all() for corners, _ in own)
    seen = _seen(own) if whole else []
    made = [(i, _light(part)) for i, part in enumerate(seen) if len(part[1])]
    after = sum(len(faces) for _, (_, faces) in made)
    kept: list[Any] = []
    files: dict[str, bytes] = {}
    if made and after <= _WORTH * before:
        for i, surface in made:
            files[f"{len(kept)}.ply"] = _ply(*surface)
            kept.append({name: getattr(shape.parts[i].material, name) for name in FINISH})
    about = {
        "file": Path(path).name,
        "fast-simplification": version("fast-simplification"),
        "triangles": [before, after],
        "parts": kept,
    }
    return {**files, "parts.json": json.dumps(about, indent=1).encode()}


def _has_textures(shape: Any) -> bool:
    materials = [part.material for part in shape.parts]
    return any(getattr(m, f"{name}_texture") for m in materials for name in TEXTURES)


def _welded(part: Any, scale: Floats) -> Surface:
    """Return a part's corners (m), each once, and its triangles."""
    own = np.asarray(part.vertices, np.float64) * scale
    corners, place = np.unique(own, axis=0, return_inverse=True)
    faces = place.reshape(-1)[np.asarray(part.triangles, np.int64)]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    return corners, faces[:, ::-1] if scale.prod() < 0 else faces


def _joined(pieces: Sequence[Surface]) -> Surface:
    """Return the corners and triangles of all pieces, one after the other."""
    starts = np.cumsum([0, *(len(corners) for corners, _ in pieces)])
    faces = [own + start for (_, own), start in zip(pieces, starts[:-1], strict=True)]
    return np.concatenate([corners for corners, _ in pieces]), np.concatenate(faces)


def _seen(parts: Sequence[Surface]) -> list[Surface]:
    """Return parts without the triangles inside of them, which are not seen.

    Space is divided into cells of `_OPENING`. Those that no surface crosses are outside, if they
    are connected with what is around all parts; a triangle is seen that crosses a cell beside one.
    """
    import trimesh
    from scipy import ndimage

    if not any(len(faces) for _, faces in parts):
        return list(parts)
    corners, faces = _joined(parts)
    size = np.ceil(np.ptp(corners, axis=0) / _OPENING) + 3
    if size.prod() > _MOST_CELLS:
        return list(parts)
    whole = trimesh.Trimesh(corners, faces, process=False)
    between, on = _sampled(whole, (1, _MOST_POINTS, _OPENING**2 / _IN_CELL))
    points = np.concatenate([between, whole.triangles_center, *np.moveaxis(whole.triangles, 1, 0)])
    on = np.concatenate([on, np.tile(np.arange(len(faces)), 4)])
    x, y, z = ((points - corners.min(0)) / _OPENING + 1).astype(np.int64).T
    crossed = np.zeros(size.astype(np.int64), bool)
    crossed[x, y, z] = True
    around: Any = ndimage.label(~crossed)
    outside = around[0] == around[0][0, 0, 0]
    beside: Any = ndimage.binary_dilation(outside, np.ones((3, 3, 3), bool))
    shown = np.zeros(len(faces), bool)
    shown[on[beside[x, y, z]]] = True
    ends = np.cumsum([len(own) for _, own in parts])[:-1]
    return [(c, own[s]) for (c, own), s in zip(parts, np.split(shown, ends), strict=True)]


def _light(part: Surface) -> Surface:
    """Return a part with fewer triangles, its connected pieces one after the other."""
    return _joined([_decimated(piece) for piece in _pieces(*part)])


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
        yield _used(corners, rows)


def _used(corners: Floats, faces: Faces) -> Surface:
    """Return triangles, and of the corners those that are theirs."""
    used, place = np.unique(faces, return_inverse=True)
    return corners[used], place.reshape(-1, 3)


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
        if not len(lighter[1]):
            break
        corrected = _corrected(lighter, best, whole)
        if len(corrected[1]) > _GAIN * len(best[1]):
            break
        best = corrected
    return best


def _corrected(lighter: Surface, best: Surface, whole: Surface) -> Surface:
    """Return a lighter surface with what is too far from the whole one taken from the best one."""
    near, gap, on = _nearest(lighter, whole)
    right = _of_triangles(gap, on, lighter) <= DEVIATION
    lost = _away(whole, lighter, right) > DEVIATION
    corner = np.isin(np.arange(len(lighter[0])), lighter[1][~right])
    lost[near[np.concatenate([~right, corner, ~right[on]])]] = True  # where wrong ones go
    back = lost if best is whole else _standing_for(lost, whole, best)
    faces = np.concatenate([lighter[1][right], best[1][back] + len(lighter[0])])
    return _used(np.concatenate([lighter[0], best[0]]), faces)


def _standing_for(lost: NDArray[np.bool_], whole: Surface, best: Surface) -> NDArray[np.bool_]:
    """Return which triangles of the best surface are where some of the whole one are, (T,)."""
    if not lost.any():
        return np.zeros(len(best[1]), bool)
    near, _, on = _nearest(best, whole)
    there = _of_triangles(lost[near], on, best)
    there[_nearest(_used(whole[0], whole[1][lost]), best)[0]] = True
    return there


def _away(surface: Surface, other: Surface, right: NDArray[np.bool_] | None = None) -> Floats:
    """Return how far each triangle of a surface is from another surface, (T,) (m).

    That of its corners, its middle, and of points on it.

    Args:
        surface: The surface.
        other: The other one.
        right: Which triangles of the other one count, (T,).
    """
    _, gap, on = _nearest(surface, other, right)
    return _of_triangles(gap, on, surface)


def _of_triangles(values: NDArray[Any], on: NDArray[np.int64], surface: Surface) -> NDArray[Any]:
    """Return of each triangle the largest of the values of its points, which `_nearest` chose."""
    middles, corners, between = np.split(values, np.cumsum([len(surface[1]), len(surface[0])]))
    largest = np.maximum(middles, corners[surface[1]].max(1))
    np.maximum.at(largest, on, between)
    return largest


def _nearest(
    surface: Surface, other: Surface, right: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int64], Floats, NDArray[np.int64]]:
    """Return where another surface is nearest to points of a surface.

    Args:
        surface: The surface.
        other: The other one.
        right: Which triangles of the other one count, (T,).

    Returns:
        For the middles of all triangles, all corners and points between them, the nearest triangle
        of the other surface, (P,), and how far it is, (P,) (m): to the nearest of some, so that it
        is never taken for too small. That of a middle faces the same way, as it is drawn from one
        side only; infinity if none of these does. Then on which triangles the points between are,
        (B,).
    """
    import trimesh
    from scipy.spatial import KDTree

    own, mesh = (trimesh.Trimesh(*each, process=False) for each in (surface, other))
    across = np.cross(*_sides(other))
    between, on = _sampled(own, _POINTS)
    points = np.concatenate([own.triangles_center, surface[0], between])
    upright = np.zeros((len(points), 3))
    upright[: len(surface[1])] = np.cross(*_sides(surface))
    places, triangle = _sampled(mesh, _PLACES)
    places = np.concatenate([places, mesh.triangles_center])
    triangle = np.concatenate([triangle, np.arange(len(mesh.faces))])
    near: Any = KDTree(places).query(points, _NEAREST)[1]
    near = triangle[np.minimum(near, len(triangle) - 1)]
    found, gap = np.empty(len(points), np.int64), np.empty(len(points))
    for start in range(0, len(points), _TOGETHER):
        block = slice(start, start + _TOGETHER)
        corners = mesh.triangles[near[block]].reshape(-1, 3, 3)
        repeated = points[block].repeat(_NEAREST, axis=0)
        closest: Any = trimesh.triangles.closest_point(corners, repeated)
        gaps = np.linalg.norm(closest - repeated, axis=1).reshape(-1, _NEAREST)
        alike = (upright[block][:, None] * across[near[block]]).sum(2) >= 0
        gaps[~(alike if right is None else alike & right[near[block]])] = np.inf
        first = gaps.argmin(1)
        rows = np.arange(len(first))
        found[block], gap[block] = near[block][rows, first], gaps[rows, first]
    return found, gap, on


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
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    across = np.cross(*_sides((corners, faces)))
    one, other = _meeting(faces, across)
    at = faces.reshape(-1)
    links = coo_array((np.ones(len(one), bool), (one, other)), shape=(at.size,) * 2)
    count, place = connected_components(links, directed=False)
    normals, places = np.zeros((count, 3)), np.empty((count, 3))
    np.add.at(normals, place, across.repeat(3, axis=0))
    places[place] = corners[at]
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 0, normals / np.where(size > 0, size, 1), [[0.0, 0.0, 1.0]])
    mesh = trimesh.Trimesh(places, place.reshape(-1, 3), vertex_normals=normals, process=False)
    contents: Any = mesh.export(file_type="ply", vertex_normal=True)
    return contents


def _meeting(faces: Faces, across: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the places in `faces`, flat, at which triangles meet that are shaded as one surface.

    Args:
        faces: The triangles.
        across: A vector along the normal of each, (T, 3).
    """
    length = np.linalg.norm(across, axis=1, keepdims=True)
    upright = across / np.where(length > 0, length, 1)
    start = np.arange(faces.size)
    sides = np.stack([start, np.roll(start.reshape(-1, 3), -1, axis=1).reshape(-1)], axis=1)
    corners = faces.reshape(-1)[sides]
    turned = corners[:, 0] > corners[:, 1]
    sides[turned], corners[turned] = sides[turned, ::-1], corners[turned, ::-1]
    order = np.lexsort(corners.T)
    shared = (corners[order[1:]] == corners[order[:-1]]).all(1)
    first, second = order[:-1][shared], order[1:][shared]
    smooth = (upright[first // 3] * upright[second // 3]).sum(1) > _CREASE
    return sides[first[smooth]].reshape(-1), sides[second[smooth]].reshape(-1)
