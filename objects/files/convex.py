"""Convex parts of a mesh: what physics collides with."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from objects.shapes import MOST_CORNERS, Place
from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.importing import optional
from robot_layouts.kinematics.rotations import Floats

MOST_PARTS = 24
_CONVEX = 0.97  # share of its hull's volume that a convex mesh fills
_MOST_BODIES = 64  # that are told apart in one mesh
_FEW = 32  # corners of a part that is one of several
_NEAR = 2e-4  # of a part's size; corners nearer to a hull than this are left out
_COACD = {  # its settings: a search that takes seconds, and is as good for things of a table
    "threshold": 0.05,  # share of its size by which a part may be hollow
    "preprocess_resolution": 30,
    "resolution": 1000,
    "mcts_nodes": 10,
    "mcts_iterations": 60,
    "mcts_max_depth": 2,
    "seed": 0,
}
_FINE = {"threshold": 0.01, "mcts_iterations": 60, "seed": 0}  # for what others are to fit into
_DIGITS = 7  # of a coordinate (m)


def convex_parts(
    mesh: Any, most: int, where: str, *, fine: bool = False
) -> list[tuple[Place, ...]]:
    """Return the corners of convex parts that fill a mesh (m).

    Bodies of the mesh that are convex are parts as they are. What is hollow is taken apart by
    CoACD, always in the same way.

    Args:
        mesh: A trimesh whose faces share their corners.
        most: How many parts there may be; 1 takes the convex hull of all.
        where: The file, for messages.
        fine: Whether its hollows are to be right to a hundredth of its size, not a twentieth.

    Raises:
        DescriptorError: If nothing of the mesh has a volume.
        MissingPackageError: If the mesh is hollow and the package coacd is not installed.
    """
    bodies = list(_bodies(mesh)) if most > 1 else []
    if most == 1:
        parts = [np.asarray(mesh.vertices, float)]
    elif len(bodies) <= _MOST_BODIES and all(_is_convex(*body) for body in bodies):
        parts = [corners for corners, _ in bodies]
    else:
        parts = _taken_apart(mesh, most, where, _FINE if fine else _COACD)
    limit = MOST_CORNERS if len(parts) == 1 else _FEW
    found = [rounded(few_corners(part, limit)) for part in parts if hull_of(part) is not None]
    if not found:
        raise DescriptorError(f"{where}: the mesh has no volume, so that it cannot collide")
    return found


def few_corners(points: Floats, most: int) -> Floats:
    """Return corners whose convex hull is nearly that of some points, (n, 3) (m).

    The farthest point is added again and again, until all are near or there are enough.

    Args:
        points: (m, 3) (m).
        most: How many corners there may be.
    """
    hull = hull_of(points)
    corners = points if hull is None else points[np.sort(hull.vertices)]
    if hull is None or len(corners) <= most:
        return corners
    near = _NEAR * float(np.ptp(corners, axis=0).max())
    ends = [way(corners @ axis) for axis in np.eye(3) for way in (np.argmin, np.argmax)]
    chosen = [int(i) for i in dict.fromkeys(ends)]
    while len(chosen) < most:
        outside = _outside(corners, corners[chosen])
        if outside.max() < near:
            break
        chosen.append(int(outside.argmax()))
    return corners[sorted(chosen)]


def hull_volume(points: Floats) -> float:
    """Return the volume of the convex hull of points, (n, 3) (m); 0 if they are flat (m³)."""
    hull = hull_of(points)
    return 0.0 if hull is None else float(hull.volume)


def _outside(points: Floats, corners: Floats) -> Floats:
    """Return how far points are outside the hull of corners, at least, (n,) (m)."""
    hull = hull_of(corners)
    if hull is None:  # the first corners are flat: how far points are from their middle
        away = points - corners.mean(axis=0)
        _, ways = np.linalg.eigh((corners - corners.mean(axis=0)).T @ (corners - corners.mean(0)))
        return np.abs(away @ ways[:, 0])
    return (points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)


def hull_of(points: Floats) -> Any:
    """Return SciPy's hull of points, or None if they are flat.

    Raises:
        MissingPackageError: If SciPy is not installed.
    """
    spatial = _scipy("spatial")
    try:
        return spatial.ConvexHull(points)
    except (spatial.QhullError, ValueError):
        return None


def _bodies(mesh: Any) -> Iterator[tuple[Floats, NDArray[np.intp]]]:
    """Yield corners and triangles of what hangs together in a mesh."""
    graphs, sparse = _scipy("sparse.csgraph"), _scipy("sparse")
    faces, corners = np.asarray(mesh.faces, np.intp), np.asarray(mesh.vertices, float)
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    links = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(corners),) * 2)
    _, labels = graphs.connected_components(links, directed=False)
    for label in np.unique(labels[faces[:, 0]]):
        own = faces[labels[faces[:, 0]] == label]
        used, numbered = np.unique(own, return_inverse=True)
        yield corners[used], numbered.reshape(-1, 3)


def _is_convex(corners: Floats, triangles: NDArray[np.intp]) -> bool:
    """Tell whether a body fills its hull; one that is open or inside out does not."""
    one, two, three = corners[triangles].transpose(1, 0, 2)
    volume = float(np.einsum("ij,ij->i", one, np.cross(two, three)).sum() / 6)
    around = hull_volume(corners)
    return bool(around > 0 and volume >= _CONVEX * around)


def _taken_apart(mesh: Any, most: int, where: str, settings: Mapping[str, Any]) -> list[Floats]:
    otherwise = "" if settings is _FINE else " (its convex hull does not: most_parts=1)"
    what = f"{where} is hollow; taking it apart needs CoACD{otherwise}"
    coacd = optional("coacd", what, "objects")
    print(f"taking {where} apart into convex parts, once; it may take a minute", file=sys.stderr)
    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32)),
        max_convex_hull=most,
        **settings,
    )
    return [np.asarray(corners, float) for corners, _ in parts]


def _scipy(module: str) -> Any:
    return optional(f"scipy.{module}", "an object from a file needs SciPy", "objects")


def rounded(corners: Floats) -> tuple[Place, ...]:
    """Return corners, (n, 3) (m), as plain numbers, to a tenth of a micrometre."""
    return tuple((round(x, _DIGITS), round(y, _DIGITS), round(z, _DIGITS)) for x, y, z in corners)
