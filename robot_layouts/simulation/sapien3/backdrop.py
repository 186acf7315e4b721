"""What a camera sees that stands still: drawn once, then laid behind what moves.

A pixel shows what is nearest to the camera. So what moves is drawn alone, and each pixel is taken
from the nearer one of the two pictures: to the last bit what a picture of everything shows, as long
as nothing is see-through and no two surfaces are equally far away.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sapien.render import RenderBodyComponent

from robot_layouts.simulation.sapien3.world import BuiltWorld

LAYERED = "minimal"  # the shaders whose images can be laid over each other
COLOR, PLACE, DEPTH = "Color", "PositionSegmentation", "GbufferDepth"  # SAPIEN's names of images

_PIXEL = {COLOR: np.uint32, PLACE: np.uint64}  # four channels as one number
_OPAQUE = 255
_MARGIN = 2.0  # pixels beside a picture that count as seen
_SLACK = 1e-3  # m, likewise

Planes = NDArray[np.float64]


class DrawnBodies:
    """What is drawn of one world but for its markers: bodies that stand still, and the others.

    Attributes:
        solid: Whether none of it is see-through.
    """

    def __init__(self, world: BuiltWorld) -> None:
        """Sort them; nothing is hidden yet."""
        markers = {b.entity for b in world.bodies.values() if b.declared.marker}
        fixed = {b.entity for b in world.bodies.values() if b.declared.kind == "static"}
        fixed |= {robot.root.entity for robot in world.robots.values()}
        place = {entity: i for i, entity in enumerate(world.scene.entities)}
        drawn = [c for e in place if e not in markers for c in _drawn(e)]
        self._still = [c for c in drawn if c.entity in fixed]
        self._moving = [c for c in drawn if c.entity not in fixed]
        self._places = [place[c.entity] for c in self._still]
        self._pack = world.scene.pack_poses
        self._hidden = set[Any]()
        self.solid = all(map(_is_solid, drawn))

    def still_poses(self) -> bytes:
        """Return where everything is that stands still: unlike others if some of it was moved."""
        poses = np.frombuffer(self._pack(), np.float32).reshape(-1, 7)
        return poses[self._places].tobytes()

    def show_all(self) -> None:
        """Let everything be drawn."""
        self._hide(set())

    def show_still(self) -> None:
        """Let only that be drawn which stands still."""
        self._hide(set(self._moving))

    def show_moving(self, views: Sequence[Planes]) -> None:
        """Let only that be drawn which moves and which some camera may see.

        Args:
            views: What `planes` returned of each camera.
        """
        self._hide(_unseen(self._moving, views).union(self._still))

    def show_seen(self, view: Planes) -> None:
        """Let all be drawn that a camera may see; see `show_moving`."""
        self._hide(_unseen([*self._still, *self._moving], [view]))

    def _hide(self, hidden: set[Any]) -> None:
        for body in hidden ^ self._hidden:
            body.visibility = float(body in self._hidden)
        self._hidden = hidden


class Backdrop:
    """A camera's picture of what stands still.

    Attributes:
        planes: What the camera sees; see `planes`.
    """

    def __init__(self, camera: Any, poses: bytes) -> None:
        """Keep the picture that a camera took.

        Args:
            camera: SAPIEN's camera.
            poses: What `DrawnBodies.still_poses` returned then.
        """
        self.planes = planes(camera)
        self._poses, self._camera = poses, _place_of(camera)
        self._depth = camera.get_picture(DEPTH)
        self._images = {name: camera.get_picture(name) for name in _PIXEL}

    def fits(self, camera: Any, poses: bytes) -> bool:
        """Tell whether it is what the camera would see now of what stands still."""
        return self._poses == poses and self._camera == _place_of(camera)

    def behind(self, camera: Any, names: Iterable[str]) -> dict[str, NDArray[Any]] | None:
        """Return pictures of everything, (H, W, 4) each, by their names.

        Args:
            camera: SAPIEN's camera, which took pictures of what moves.
            names: Some of `COLOR` and `PLACE`.

        Returns:
            None if something that moves is as far away as what is behind it: which of them shows
            is decided by the order in which they are drawn.
        """
        depth, color = camera.get_picture(DEPTH), camera.get_picture(COLOR)
        nearer = depth < self._depth
        if (color[..., 3][depth == self._depth] != 0).any():
            return None
        return {
            name: self._joined(name, nearer, color if name == COLOR else camera.get_picture(name))
            for name in names
        }

    def _joined(self, name: str, nearer: NDArray[np.bool_], front: NDArray[Any]) -> NDArray[Any]:
        pixel, back = _PIXEL[name], self._images[name]
        joined = np.where(nearer[..., None], front.view(pixel), back.view(pixel))
        return joined.view(back.dtype)


def planes(camera: Any) -> Planes:
    """Return the five planes between which a camera sees something, (5, 4) (m, world).

    A point (x, y, z) is inside of one where its product with (x, y, z, 1) is positive.
    """
    (fx, _, cx), (_, fy, cy), _ = camera.get_intrinsic_matrix().astype(np.float64)
    right, bottom = camera.width - cx + _MARGIN, camera.height - cy + _MARGIN
    left, top = cx + _MARGIN, cy + _MARGIN
    inward = [[fx, 0, left], [-fx, 0, right], [0, fy, top], [0, -fy, bottom], [0, 0, 1]]
    found = np.array(inward, np.float64)
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return found @ camera.get_extrinsic_matrix().astype(np.float64)


def _unseen(bodies: Sequence[Any], views: Sequence[Planes]) -> set[Any]:
    """Return the bodies that are for each camera outside of one of its planes."""
    boxes = np.array([body.get_global_aabb_fast() for body in bodies]).reshape(-1, 2, 3)
    middle, half = (boxes[:, 1] + boxes[:, 0]) / 2, (boxes[:, 1] - boxes[:, 0]) / 2
    seen = np.zeros(len(boxes), bool)
    for view in views:
        ahead = middle @ view[:, :3].T + view[:, 3] + half @ np.abs(view[:, :3]).T
        seen |= (ahead > -_SLACK).all(1)
    return {body for body, s in zip(bodies, seen.tolist(), strict=True) if not s}


def _place_of(camera: Any) -> bytes:
    return camera.get_model_matrix().tobytes() + camera.get_intrinsic_matrix().tobytes()


# -- what is see-through -------------------------------------------------------------------------


def _drawn(entity: Any) -> list[Any]:
    component: Any = entity.find_component_by_type(RenderBodyComponent)
    return [component] if component is not None and component.render_shapes else []


def _is_solid(body: Any) -> bool:
    return all(
        part.material.base_color[3] == 1 and _hides(part.material.base_color_texture, shape, i)
        for shape in body.render_shapes
        for i, part in enumerate(shape.parts)
    )


def _hides(texture: Any, shape: Any, part: int) -> bool:
    """Tell whether a texture is nowhere see-through; one of a file is looked at once."""
    if texture is None or texture.channels < 4:
        return True
    file = texture.filename or f"{getattr(shape, 'filename', '')}#{part}"
    return _file_hides(file, _Once(texture)) if file[0] != "#" else _all_opaque(texture)


class _Once:
    """A texture that a cache does not tell from others of its file."""

    def __init__(self, texture: Any) -> None:
        self.texture = texture

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Once)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=1024)
def _file_hides(file: str, once: _Once) -> bool:
    return _all_opaque(once.texture)


def _all_opaque(texture: Any) -> bool:
    return bool((texture.download()[..., 3] == _OPAQUE).all())
