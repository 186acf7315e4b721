"""What bodies look like: turns shapes into what SAPIEN draws. Loaded only where pictures are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import sapien
from sapien.render import (
    RenderBodyComponent,
    RenderMaterial,
    RenderShapeBox,
    RenderShapeCapsule,
    RenderShapeCylinder,
    RenderShapePlane,
    RenderShapeSphere,
    RenderShapeTriangleMesh,
    RenderTexture2D,
)

from objects.shapes import (
    Box,
    Capsule,
    ConvexHull,
    Cylinder,
    Floor,
    Mesh,
    Plane,
    Shape,
    Sphere,
)
from objects.solids import Triangles, hull_triangles
from robot_layouts.simulation.sapien3.light_meshes import TEXTURES
from robots.descriptor import Vector3

_PLANE_HALF_SIZE = 50.0  # of what is drawn of an infinite plane (m)


def visual_component(shapes: tuple[Shape, ...]) -> RenderBodyComponent | None:
    """Return what is drawn of a body, or None if nothing is."""
    visuals = [visual for _, visual in drawn_shapes(shapes)]
    if not visuals:
        return None
    component = RenderBodyComponent()
    for visual in visuals:
        component.attach(visual)
    return component


def drawn_shapes(shapes: tuple[Shape, ...]) -> Iterator[tuple[Shape, Any]]:
    """Yield the shapes that are drawn, and what SAPIEN draws of each, at its place in the body."""
    for shape in shapes:
        if shape.visible:
            visual = _visual(shape)
            visual.local_pose = sapien.Pose(list(shape.position), list(shape.quaternion))
            yield shape, visual


def stretch(shape: Shape) -> Vector3:
    """Return what SAPIEN multiplies the corners of what it draws with, along each axis."""
    match shape:
        case Box():
            return shape.half_size
        case Sphere():
            return shape.radius, shape.radius, shape.radius
        case Cylinder():
            return shape.half_length, shape.radius, shape.radius
        case Plane():
            return 1.0, _PLANE_HALF_SIZE, _PLANE_HALF_SIZE
        case Mesh():
            return shape.scale
        case _:
            return 1.0, 1.0, 1.0


def _visual(shape: Shape) -> Any:
    match shape:
        case Box():
            return RenderShapeBox(list(shape.half_size), _material(shape))
        case Sphere():
            return RenderShapeSphere(shape.radius, _material(shape))
        case Cylinder():
            return RenderShapeCylinder(shape.radius, shape.half_length, _material(shape))
        case Capsule():
            return RenderShapeCapsule(shape.radius, shape.half_length, _material(shape))
        case Plane():
            return RenderShapePlane([_PLANE_HALF_SIZE] * 3, _material(shape))
        case ConvexHull():
            return _hull(shape)
        case Mesh():
            return _mesh(shape)
        case Floor():
            return _floor(shape)
        case _:
            raise TypeError(f"no picture for {type(shape).__name__}")


def _material(shape: Shape) -> RenderMaterial:
    finish = shape.finish
    return RenderMaterial(
        base_color=list(shape.color),
        metallic=finish.metallic,
        roughness=finish.roughness,
        specular=finish.specular,
    )


def _mesh(shape: Mesh) -> RenderShapeTriangleMesh:
    """A mesh as its file paints it, or in one colour with the finish that its file says."""
    mesh = RenderShapeTriangleMesh(str(shape.path), list(shape.scale), None)
    if not shape.textured:
        for part in mesh.parts:
            part.material.set_base_color(list(shape.color))
            for texture in TEXTURES:
                getattr(part.material, f"set_{texture}_texture")(None)
    return mesh


def _hull(shape: ConvexHull) -> RenderShapeTriangleMesh:
    """Flat faces: each triangle has corners of its own."""
    triangles = hull_triangles(shape.corners)
    normals = Triangles(np.array(shape.corners), triangles).normals
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return RenderShapeTriangleMesh(
        vertices=np.array(shape.corners)[triangles].reshape(-1, 3),
        triangles=np.arange(triangles.size).reshape(-1, 3),
        normals=np.repeat(normals, 3, axis=0),
        uvs=np.zeros((triangles.size, 2)),
        material=_material(shape),
    )


def _floor(shape: Floor) -> RenderShapeTriangleMesh:
    """Squares of 1 m around the origin, two triangles each, their normals along +z."""
    along = np.arange(shape.size + 1) - shape.size / 2
    first, second = np.meshgrid(along, along, indexing="ij")
    places = np.stack([first, second, np.zeros_like(first)], axis=-1).reshape(-1, 3)
    corner = np.arange(shape.size)[:, None] * (shape.size + 1) + np.arange(shape.size)
    beside, ahead = corner + 1, corner + shape.size + 1
    triangles = [(corner, ahead, beside), (ahead, ahead + 1, beside)]
    material = RenderMaterial()
    material.base_color_texture = RenderTexture2D(str(shape.texture), mipmap_levels=shape.mipmaps)
    return RenderShapeTriangleMesh(
        vertices=places,
        triangles=np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in triangles]),
        normals=np.tile([0.0, 0.0, 1.0], (len(places), 1)),
        uvs=places[:, :2] / shape.tile + 0.5,
        material=material,
    )
