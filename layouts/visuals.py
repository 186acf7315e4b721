"""What a robot looks like: the meshes and shapes that its URDF draws, with their colours."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots import AssetError
from robots.bodies.hulls import primitive
from robots.urdf.mesh_files import expect_near, load_scene
from robots.urdf.model import UrdfShape
from robots.urdf.paths import resolve
from robots.urdf.reading import model_of
from robots.urdf.summary import root_of
from robots.urdf.text import numbers_of

Rgba = tuple[float, float, float, float]  # 0 … 1

GREY: Rgba = (0.7, 0.7, 0.7, 1.0)
SIDES = 48  # of the polygon that stands for a circle
MANY_TRIANGLES = 60_000  # of one mesh; with more it is drawn coarser
MOST_TRIANGLES = 200_000  # of one mesh; MuJoCo reads no more
FEW_TRIANGLES = 500  # of one mesh; with more its hull is drawn in quick pictures
COARSE_CELLS = 40  # along the longest side of such a mesh
CELLS = 300  # along the longest side of a mesh that is drawn coarser


@dataclass(frozen=True, eq=False)
class Visual:
    """One mesh of one colour or texture, fixed to a link.

    Attributes:
        mesh: A trimesh, in the frame of what it is fixed to (m); its material is in ``visual``.
        rgba: Its colour, or the main colour of its material.
    """

    mesh: Any
    rgba: Rgba


def read_visuals(urdf: Path) -> dict[str, tuple[Visual, ...]]:
    """Return what a URDF draws of each link that it draws.

    Args:
        urdf: A URDF with its visual meshes beside it, as ``locate(pictures=True)`` returns it.

    Raises:
        AssetError: If a mesh is missing or cannot be read or is as large as no robot, or a shape
            is unknown.
    """
    root, model = root_of(urdf), model_of(urdf)
    colours = dict(_named_colours(root, urdf))
    drawn: dict[str, tuple[Visual, ...]] = {}
    for link in root.iterfind("link"):
        shapes = model.visuals.get(link.get("name", ""), ())
        parts = tuple(
            part
            for shape, visual in zip(shapes, link.iterfind("visual"), strict=True)
            for part in _visual_parts(shape, _colour(visual, urdf, colours), urdf)
        )
        if parts:
            drawn[link.get("name", "")] = parts
    return drawn


def coloured(mesh: Any, rgba: Rgba) -> Visual:
    """Return a trimesh as a part of one colour."""
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    mesh.visual = TextureVisuals(
        material=PBRMaterial(
            baseColorFactor=np.round(np.array(rgba) * 255).astype(np.uint8),
            metallicFactor=0.0,
            roughnessFactor=0.7,
            alphaMode="BLEND" if rgba[3] < 1 else "OPAQUE",
        )
    )
    return Visual(mesh, rgba)


def simplified(part: Visual, cells: int = CELLS) -> Visual:
    """Return a part whose corners lie on a fine grid, if it has very many triangles.

    Corners move by less than 1/300 of the mesh's longest side; by more only if more than
    `MOST_TRIANGLES` would be left.

    Args:
        part: The part.
        cells: Of the grid, along the mesh's longest side.
    """
    import trimesh

    mesh = part.mesh
    if len(mesh.faces) <= MANY_TRIANGLES:
        return part
    cell = float(np.ptp(mesh.vertices, axis=0).max()) / cells
    places, corner = np.unique(np.round(mesh.vertices / cell), axis=0, return_inverse=True)
    faces = corner.reshape(-1)[mesh.faces]
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    _, first = np.unique(np.sort(faces[distinct], axis=1), axis=0, return_index=True)
    faces = faces[distinct][np.sort(first)]
    if len(faces) > MOST_TRIANGLES:
        return simplified(part, cells // 2)
    return coloured(trimesh.Trimesh(places * cell, faces, process=False), part.rgba)


def coarse(part: Visual) -> Visual:
    """Return the convex hull of a part that has many triangles, for quick pictures.

    Corners move by less than 1/80 of its longest side.
    """
    import trimesh
    from scipy.spatial import QhullError

    mesh = part.mesh
    if len(mesh.faces) <= FEW_TRIANGLES:
        return part
    cell = float(np.ptp(mesh.vertices, axis=0).max()) / COARSE_CELLS
    places = np.unique(np.round(mesh.vertices / cell), axis=0) * cell
    try:
        return coloured(trimesh.convex.convex_hull(places), part.rgba)
    except QhullError:  # it is flat
        return simplified(part)


def _named_colours(root: Element, urdf: Path) -> Iterator[tuple[str, Rgba]]:
    for material in root.iter("material"):
        color = material.find("color")
        if color is not None:
            yield material.get("name", ""), _rgba(color, urdf)


def _rgba(color: Element, urdf: Path) -> Rgba:
    red, green, blue, alpha = numbers_of(color, "rgba", GREY, str(urdf))
    return (red, green, blue, alpha)


def _colour(visual: Element, urdf: Path, colours: Mapping[str, Rgba]) -> Rgba | None:
    """Return the colour that a visual has or names, or None if it has none."""
    material = visual.find("material")
    if material is None:
        return None
    color = material.find("color")
    return colours.get(material.get("name", "")) if color is None else _rgba(color, urdf)


def _visual_parts(shape: UrdfShape, rgba: Rgba | None, urdf: Path) -> Iterator[Visual]:
    if shape.kind == "mesh":
        yield from _mesh_parts(shape, urdf, shape.origin @ np.diag([*shape.sizes, 1.0]), rgba)
        return
    mesh = primitive(shape, SIDES)
    mesh.apply_transform(shape.origin)
    yield coloured(mesh, rgba or GREY)


def _mesh_parts(shape: UrdfShape, urdf: Path, pose: Floats, rgba: Rgba | None) -> Iterator[Visual]:
    path = resolve(shape.file, urdf.as_posix(), os.path.isfile)
    for mesh in load_meshes(path, shape.where, urdf.as_posix()):
        mesh.apply_transform(pose)
        expect_near(mesh.vertices, path, shape.where)
        own = _own_colour(mesh)
        yield coloured(mesh, rgba or GREY) if own is None else Visual(mesh, own)


def load_meshes(path: str, where: str, urdf: str | None = None) -> list[Any]:
    """Return the trimeshes of a file, each in the file's frame.

    Args:
        path: The file.
        where: What refers to it, for error messages.
        urdf: The URDF that it belongs to, if it belongs to one.

    Raises:
        AssetError: If it does not exist, or holds no mesh that can be read.
    """
    import trimesh

    scene = load_scene(path, where, urdf)
    try:
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
    except Exception as error:  # what the reader left behind may be anything
        raise AssetError(f"{where}: cannot read the mesh {path}: {error}") from error
    if not meshes:
        raise AssetError(f"{where}: the file {path} holds no mesh")
    return meshes


def _own_colour(mesh: Any) -> Rgba | None:
    """Return the main colour that a mesh file gives its mesh, or None if it gives none."""
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return None
    red, green, blue, alpha = (np.asarray(material.main_color, float) / 255).tolist()
    return (red, green, blue, alpha)


def mean_color(mesh: Any) -> Rgba:
    """Return the mean colour of the texture of a trimesh, or else its material's main colour."""
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
        red, green, blue = (pixels.mean(0) / 255).tolist()
        return red, green, blue, 1.0
    main = getattr(material, "main_color", (180, 180, 180, 255))
    red, green, blue, alpha = (np.asarray(main, float) / 255).tolist()
    return red, green, blue, alpha


def shown_color(color: Rgba) -> Rgba:
    """Return a colour of light, which is linear, as screens encode it."""
    red, green, blue = (np.array(color[:3]) ** (1 / 2.2)).tolist()
    return red, green, blue, color[3]
