"""What robots look like and collide with, as mesh files that other programs read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from layouts.export.cell import RobotSource
from layouts.export.files import Names
from layouts.visuals import GREY, Rgba, read_visuals, simplified
from robot_layouts.core.importing import optional
from robots import AssetError
from robots.bodies.hulls import shape_corners
from robots.urdf.mesh_files import binary_stl
from robots.urdf.model import SIZES, UrdfShape

AS_HULLS = ("mesh", "capsule")  # of which most formats' own shapes are not what they are here
LEAST_AREA = 1e-12  # m²; a mesh with less is too small to be seen, and is not drawn


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh that is drawn.

    Attributes:
        mesh: A trimesh in the link's frame (m).
        rgba: Its colour.
    """

    mesh: Any
    rgba: Rgba


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A shape that collides.

    Attributes:
        shape: The shape of the URDF.
        mesh: Its convex hull in the link's frame, a trimesh (m); None for a shape that the format
            has itself.
        convex: Whether it is that; else the mesh is the very surface that collides.
    """

    shape: UrdfShape
    mesh: Any
    convex: bool = True


def drawn_meshes(source: RobotSource, *, visuals: bool) -> dict[str, tuple[Drawn, ...]]:
    """Return what is drawn of each link; meshes of very many triangles are made coarser.

    Meshes without an area are left out.

    Args:
        source: The robot.
        visuals: Whether anything is to be drawn.

    Raises:
        AssetError: If a mesh is missing or cannot be read.
        MissingPackageError: If trimesh is not installed.
    """
    if not visuals:
        return {}
    if not source.drawn:
        solids = solid_shapes(source, hulls=tuple(SIZES))
        return {link: tuple(Drawn(s.mesh, GREY) for s in some) for link, some in solids.items()}
    parts = read_visuals(source.urdf)
    coarse = {link: map(simplified, of_link) for link, of_link in parts.items()}
    return {
        link: tuple(Drawn(p.mesh, p.rgba) for p in some if _area(p.mesh) > LEAST_AREA)
        for link, some in coarse.items()
    }


def _area(mesh: Any) -> float:
    """Return the area (m²) of a trimesh as single precision has it, in which it is saved."""
    one, other, last = np.moveaxis(np.asarray(mesh.triangles, np.float32), 1, 0)
    return float(np.linalg.norm(np.cross(other - one, last - one), axis=1).sum() / 2)


def solid_shapes(
    source: RobotSource, hulls: Sequence[str] = AS_HULLS
) -> dict[str, tuple[CollisionShape, ...]]:
    """Return what each link collides with: plain shapes, and convex hulls of the others.

    Args:
        source: The robot.
        hulls: Kinds of shapes that are given as their hulls, the same that checks of layouts use.

    Raises:
        AssetError: If a mesh is missing or cannot be read, or a shape has no volume.
        MissingPackageError: If scipy is not installed.
    """
    return {
        link: tuple(
            CollisionShape(
                shape,
                hull_of(shape_corners(shape, source.urdf), shape.where)
                if shape.kind in hulls
                else None,
            )
            for shape in shapes
        )
        for link, shapes in source.model.collisions.items()
    }


def hull_of(corners: Any, where: str) -> Any:
    """Return the convex hull of points, (n, 3) (m), a trimesh.

    Raises:
        AssetError: If it has no volume; ``where`` says of what.
        MissingPackageError: If scipy is not installed.
    """
    import trimesh

    optional("scipy", "convex hulls need scipy", "checks")
    try:
        return trimesh.convex.convex_hull(corners)
    except Exception as error:  # qhull's own, for what is all but flat
        raise AssetError(f"{where}: a collision shape without a volume") from error


class MeshFolder:
    """A folder of binary STL or of Wavefront files, whose names lead to no other folder."""

    def __init__(self, folder: Path, ending: str = ".stl") -> None:
        """Make it if need be; the ending of its files chooses the format."""
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._ending, self._names = folder, ending, Names()

    def save(self, mesh: Any, name: str) -> str:
        """Write a trimesh under a name like the one given, and return the file's name.

        Triangles without an area are left out of an STL.
        """
        file = f"{self._names.new(name)}{self._ending}"
        if self._ending == ".stl":
            corners = np.asarray(mesh.vertices, float)[np.asarray(mesh.faces, int)]  # (n, 3, 3)
            flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            (self._folder / file).write_bytes(binary_stl(corners[flat.any(axis=1)]))
            return file
        import trimesh

        bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        path = self._folder / file
        bare.export(path, include_normals=False, include_texture=False, include_color=False)
        return file
