"""Bodies that patterns lie on: meshes whose texture has the same size everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien.render import (
    RenderBodyComponent,
    RenderMaterial,
    RenderShapeTriangleMesh,
    RenderTexture2D,
)

from simulation.looks import Pattern
from simulation.patterns import pattern_image
from simulation.sapien3.visuals import drawn_shapes, stretch
from simulation.shapes import Shape

_WIDEST = 4.0  # m; along a longer side a pattern begins anew, as native's floor does
_MIPMAPS = 6  # of a pattern: without them it flickers where it is far away


def materials(entity: sapien.Entity) -> Iterator[Any]:
    """Yield the materials of what is drawn of a body or a link."""
    component: Any = entity.find_component_by_type(RenderBodyComponent)
    if component is not None:
        for shape in component.render_shapes:
            for part in shape.parts:
                yield part.material


def cover(covered: Iterable[Any], pattern: Pattern) -> None:
    """Give materials a pattern."""
    # Not uploaded into the texture of before: that would keep its mipmaps.
    image = RenderTexture2D(pattern_image(pattern), "r8g8b8a8unorm", _MIPMAPS)
    for material in covered:
        material.set_base_color_texture(image)


def wrap(entity: sapien.Entity, shapes: tuple[Shape, ...]) -> list[Any]:
    """Draw a body of the same shapes with meshes for patterns, and return their materials."""
    old: Any = entity.find_component_by_type(RenderBodyComponent)
    if old is None:
        return []
    drawn = list(drawn_shapes(shapes))
    meshes = [_Flat.of(shape, visual) for shape, visual in drawn]
    longest = max(float(np.ptp(mesh.corners, axis=(0, 1)).max()) for mesh in meshes)
    component = RenderBodyComponent()
    for mesh, (_, visual) in zip(meshes, drawn, strict=True):
        wrapped = mesh.wrapped(min(longest, _WIDEST))
        wrapped.local_pose = visual.local_pose
        component.attach(wrapped)
    entity.remove_component(old)
    entity.add_component(component)
    component.visibility = old.visibility
    return list(materials(entity))


class _Flat(NamedTuple):
    """Triangles that share no corner, so that each lies on a texture by itself.

    Attributes:
        corners: Shape (T, 3, 3) (m).
        normals: Of the surface at each corner, likewise.
        material: What they are of.
    """

    corners: NDArray[np.float32]
    normals: NDArray[np.float32]
    material: RenderMaterial

    @classmethod
    def of(cls, shape: Shape, visual: Any) -> _Flat:
        """Return those of a shape."""
        scale = np.array(stretch(shape), np.float32)
        corners = np.concatenate([part.vertices[part.triangles] for part in visual.parts])
        normals = np.concatenate(
            [part.get_vertex_normal()[part.triangles] for part in visual.parts]
        )
        normals = normals / scale
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        return cls(corners * scale, normals, _plain(visual.parts[0].material))

    def wrapped(self, length: float) -> RenderShapeTriangleMesh:
        """Return a mesh on which an image covers squares of a length (m), seen along the axes."""
        edges = self.corners[:, 1:] - self.corners[:, :1]
        facing = np.abs(np.cross(edges[:, 0], edges[:, 1])).argmax(1)
        across = np.array([[1, 2], [0, 2], [0, 1]])[facing]
        uvs = np.take_along_axis(self.corners, across[:, None], 2) / length + 0.5
        return RenderShapeTriangleMesh(
            vertices=self.corners.reshape(-1, 3),
            triangles=np.arange(3 * len(self.corners)).reshape(-1, 3),
            normals=self.normals.reshape(-1, 3),
            uvs=uvs.reshape(-1, 2),
            material=self.material,
        )


def _plain(material: Any) -> RenderMaterial:
    """Return a white material with the finish of another one."""
    return RenderMaterial(
        metallic=material.metallic, roughness=material.roughness, specular=material.specular
    )
