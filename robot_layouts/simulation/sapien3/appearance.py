"""What a world looks like beyond what was declared: paint, patterns, lamps, places of cameras.

Patterns lie on meshes whose texture has the same size everywhere.

All in place: SAPIEN takes other colours, textures and light in a world that is built. Every value
is set from the one that was built, so it does not depend on what was set before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from hashlib import shake_128
from math import atan2, cos, hypot, pi, sin
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

from objects.shapes import Shape
from robot_layouts.simulation.sapien3.visuals import drawn_shapes, stretch
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.variation import CameraOffset, Glow, Looks, Paint, Pattern
from robot_layouts.simulation.world import Part
from robots.descriptor import Vector3

_MOST_TILT = 1.4  # rad from the vertical; light from the horizon and below lights no table


class Appearance:
    """Dresses one world."""

    def __init__(self, world: BuiltWorld) -> None:
        """Begin with a world as it was built."""
        self._world = world
        self._surfaces: dict[Part, list[tuple[Any, list[float]]]] = {}
        self._covers: dict[str, list[Any]] = {}

    def dress(self, looks: Looks) -> None:
        """Let bodies and robots look so."""
        for name, pattern in looks.patterns.items():
            cover(self._cover(name), pattern)
        for part, paint in looks.paints.items():
            covered = part.robot is None and part.name in looks.patterns
            for material, surface in self._surface(part):
                _finish(material, paint)
                if not covered:
                    _paint(material, surface, paint)

    def _surface(self, part: Part) -> list[tuple[Any, list[float]]]:
        found = self._surfaces.get(part)
        if found is None:
            drawn = materials(_entity(self._world, part))
            found = self._surfaces[part] = [(m, list(m.base_color)) for m in drawn]
        return found

    def _cover(self, name: str) -> list[Any]:
        """Return the materials of a body whose shapes a pattern fits, made when first asked for."""
        found = self._covers.get(name)
        if found is None:
            body = self._world.bodies[name]
            found = self._covers[name] = wrap(body.entity, body.declared.shapes)
        return found


def _entity(world: BuiltWorld, part: Part) -> sapien.Entity:
    if part.robot is None:
        return world.bodies[part.name].entity
    return world.robots[part.robot].link(part.name).entity


def _finish(material: Any, paint: Paint) -> None:
    for name in ("roughness", "metallic", "specular"):
        wanted = getattr(paint, name)
        if wanted is not None:
            getattr(material, f"set_{name}")(wanted)


def _paint(material: Any, own: list[float], paint: Paint) -> None:
    color = list(own)
    for i, wanted in enumerate((paint.red, paint.green, paint.blue)):
        if wanted is not None:
            color[i] += (wanted - color[i]) * paint.share
            material.set_base_color_texture(None)
    material.set_base_color(color)


# -- light ---------------------------------------------------------------------------------------


def lamp_pose(direction: Vector3, glow: Glow) -> sapien.Pose:
    """Return the pose of a lamp that shines along its +x, by its own direction."""
    ahead: Any = [1.0, 0.0, 0.0]
    return sapien.Pose(q=sapien.math.shortest_rotation(ahead, _turned(direction, glow)))


def _turned(direction: Vector3, glow: Glow) -> Any:
    if not glow.turn and not glow.tilt:
        return list(direction)
    x, y, z = direction
    around = atan2(y, x) + glow.turn
    down = min(max(atan2(hypot(x, y), -z) + glow.tilt, -_MOST_TILT), _MOST_TILT)
    return [sin(down) * cos(around), sin(down) * sin(around), -cos(down)]


def light_color(color: Vector3, glow: Glow) -> list[float]:
    """Return a light's colour."""
    return [own * factor for own, factor in zip(color, glow.color, strict=True)]


# -- cameras -------------------------------------------------------------------------------------


def shifted(pose: sapien.Pose, shift: CameraOffset) -> sapien.Pose:
    """Return where a camera is, off its place."""
    roll, pitch, yaw = shift.rotation
    turn = sapien.Pose(list(shift.position))
    for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
        quaternion = [cos(angle / 2), 0.0, 0.0, 0.0]
        quaternion[1 + axis] = sin(angle / 2)
        turn = turn * sapien.Pose(q=quaternion)
    return pose * turn


def widened(fov: float, shift: CameraOffset) -> float:
    """Return a camera's field of view (rad), which stays below a half-turn."""
    return min(fov * shift.fov, pi - 1e-3)


SIZE = 256  # pixels along each side
_OCTAVES = 3
_FLOW = 0.7  # by how much of a ring's width the rings of wood wander
_GRAIN = 0.25  # how much of wood is fine grain

Amounts = NDArray[np.float64]


def pattern_image(pattern: Pattern) -> NDArray[np.uint8]:
    """Return the image of a pattern, (256, 256, 4): red, green, blue and 255, of light."""
    amount = _KINDS[pattern.kind](pattern.cells, pattern.seed)[..., None]
    first, second = np.array(pattern.first), np.array(pattern.second)
    colors = (first + (second - first) * amount) * 255 + 0.5
    image = np.full((SIZE, SIZE, 4), 255, np.uint8)
    image[..., :3] = colors.astype(np.uint8)
    return image


def _ramp() -> Amounts:
    """Return where the middle of each pixel is, from 0 to 1."""
    return (np.arange(SIZE) + 0.5) / SIZE


def _stripes(cells: int, seed: int) -> Amounts:
    band = np.floor(_ramp() * 2 * cells) % 2
    return np.broadcast_to(band, (SIZE, SIZE))


def _checker(cells: int, seed: int) -> Amounts:
    band = np.floor(_ramp() * 2 * cells)
    return (band[:, None] + band) % 2


def _noise(cells: int, seed: int) -> Amounts:
    """Return noise whose largest lumps are half a cell wide."""
    layers = [_lumps(cells * 2**i, cells * 2**i, seed + i) for i in range(1, _OCTAVES + 1)]
    weights = [0.5**i for i in range(_OCTAVES)]
    total = sum(weight * layer for weight, layer in zip(weights, layers, strict=True))
    return np.clip((total / sum(weights) - 0.5) * 2 + 0.5, 0.0, 1.0)


def _wood(cells: int, seed: int) -> Amounts:
    """Return rings that were cut along: lines that wander, with fine grain along them."""
    wander = _lumps(2, cells, seed) * _FLOW + _lumps(4, 2 * cells, seed + 1) * _FLOW / 2
    place = _ramp()[:, None] * cells + wander
    ring = np.abs(2 * (place - np.floor(place)) - 1)
    return ring * ring * (1 - _GRAIN) + _lumps(4, 16 * cells, seed + 2) * _GRAIN


def _lumps(across: int, along: int, seed: int) -> Amounts:
    """Return smooth noise between 0 and 1 from a grid of so many random numbers each way."""
    columns, rows = min(across, SIZE), min(along, SIZE)
    words = shake_128(f"{seed} {columns} {rows}".encode()).digest(2 * columns * rows)
    grid = np.frombuffer(words, "<u2").reshape(rows, columns) / 65535
    (down, below, far), (left, right, share) = _between(rows), _between(columns)
    upper = grid[down][:, left] * (1 - share) + grid[down][:, right] * share
    lower = grid[below][:, left] * (1 - share) + grid[below][:, right] * share
    return upper * (1 - far[:, None]) + lower * far[:, None]


def _between(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Amounts]:
    """Return for each pixel the grid lines before and behind it, and how near it is to either."""
    place = _ramp() * count
    before = np.floor(place).astype(np.intp)
    share = place - before
    return before, (before + 1) % count, share * share * (3 - 2 * share)


_KINDS = {"checker": _checker, "stripes": _stripes, "noise": _noise, "wood": _wood}


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
