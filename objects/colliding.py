"""What physics builds of a mesh: shapes that it knows, of a file that was read first."""

from __future__ import annotations

from dataclasses import replace

from objects.shapes import MOST_CORNERS, ConvexHull, Mesh, Shape
from robot_layouts.core.errors import AssetError
from robots.urdf.mesh_files import has_body, read_parts


def built_of(shape: Shape, where: str) -> tuple[Shape, ...]:
    """Return what is built of a shape: of a mesh whose parts collide, a hull for each of them.

    Args:
        shape: The shape.
        where: What it belongs to, for messages.

    Raises:
        AssetError: If it is a mesh that collides, and its file is missing, cannot be read, or is
            flat where it must not be; or if a part of it has more than `MOST_CORNERS` corners.
    """
    if not isinstance(shape, Mesh) or not shape.collides:
        return (shape,)
    if shape.collision == "parts":
        drawn = (replace(shape, collides=False),) if shape.visible else ()
        return (*drawn, *_hulls(shape, where))
    path = str(shape.path)
    if not has_body(path, shape.scale, where, path) and shape.collision == "hull":
        raise AssetError(
            f"{where}: the mesh {path} is flat, so that its hull cannot collide; one that is only"
            " drawn has collides=False"
        )
    return (shape,)


def _hulls(mesh: Mesh, where: str) -> list[ConvexHull]:
    path = str(mesh.path)
    parts = read_parts(path, mesh.scale, where)
    most = max(map(len, parts))
    if most > MOST_CORNERS:
        raise AssetError(
            f"{where}: a part of the mesh {path} has {most} corners; parts that collide have"
            f" {MOST_CORNERS} at most"
        )
    return [
        ConvexHull(
            tuple(map(tuple, part.tolist())),
            position=mesh.position,
            quaternion=mesh.quaternion,
            friction=mesh.friction,
            density=mesh.density,
            visible=False,
        )
        for part in parts
    ]
