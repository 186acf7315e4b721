"""Pictures of one world of SAPIEN's, all lit alike but for what varies."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from math import tan
from typing import Any, NamedTuple

import numpy as np
import sapien
import torch
from numpy.typing import NDArray

from robot_layouts.simulation.cameras import (
    RAW_IMAGES,
    RAY_TRACING,
    AnyCamera,
    RobotCamera,
    View,
    camera_name,
    field_of_view,
    lens_of,
    ridden,
    shaders_of,
    told_by,
)
from robot_layouts.simulation.rotations import quaternion
from robot_layouts.simulation.sapien3.appearance import (
    Appearance,
    lamp_pose,
    light_color,
    shifted,
    widened,
)
from robot_layouts.simulation.sapien3.backdrop import (
    COLOR,
    LAYERED,
    PLACE,
    Backdrop,
    DrawnBodies,
    planes,
)
from robot_layouts.simulation.sapien3.device import draws_in_software, expect_render_device
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.variation import AS_DECLARED, LIGHTS, Looks
from robots import SimulationError
from robots.descriptor import Vector3

# mani_skill 3.0.1, envs/sapien_env.py, _load_lighting: red, green, blue; directions point away
# from the lamp.
SKY = (0.3, 0.3, 0.3)
LAMPS = (((1.0, 1.0, -1.0), (1.0, 1.0, 1.0)), ((0.0, 0.0, -1.0), (1.0, 1.0, 1.0)))
SHADOW_SIZE = 5.0  # m, half the side of the square in which the first lamp casts shadows

# mani_skill 3.0.1, render/shaders.py: how each pack stores images, and what is taken from them
_FORMATS = {
    "minimal": {COLOR: "r8g8b8a8unorm", PLACE: "r16g16b16a16sint"},
    "default": {COLOR: "r32g32b32a32sfloat"},
}
_Pixels = dict[str, tuple[str, Callable[[NDArray[Any]], NDArray[Any]]]]
_QUICK: _Pixels = {
    "rgb": (COLOR, lambda x: x[..., :3]),
    "position": (PLACE, lambda x: x[..., :3]),
    "depth": (PLACE, lambda x: -x[..., 2:3]),
    "segmentation": (PLACE, lambda x: x[..., 3:]),
    **{image: (image, lambda x: x) for image in RAW_IMAGES["minimal"]},
}
_SLOW: _Pixels = {
    "rgb": (COLOR, lambda x: _scaled(x, 255, torch.uint8)),
    "depth": ("Position", lambda x: -_scaled(x, 1000, torch.int16)[..., 2:]),
    "position": ("Position", lambda x: _scaled(x, 1000, torch.int16)),
    "segmentation": ("Segmentation", lambda x: x[..., 1:2].astype(np.int64)),
    "normal": ("Normal", lambda x: x[..., :3]),
    "albedo": ("Albedo", lambda x: _scaled(x, 255, torch.uint8)),
    COLOR: (COLOR, lambda x: x),
    "Position": ("Position", lambda x: x),
    "Segmentation": ("Segmentation", lambda x: x.astype(np.int64)),
}
_PIXELS = {"minimal": _QUICK, "default": _SLOW, **dict.fromkeys(RAY_TRACING, _SLOW)}

Drawn = Callable[[], list[View]]
"""Waits until pictures are drawn, and returns what each camera sees."""


def look(
    world: BuiltWorld,
    cameras: Mapping[str, AnyCamera],
    textures: Sequence[str],
    *,
    markers: bool,
) -> Drawn:
    """Begin to draw what cameras see in a world now; see `look`."""
    expect_render_device()
    if world.studio is None:
        world.studio = Studio(world)
    return world.studio.look(cameras, textures, markers=markers)


class Studio:
    """The cameras and the lights of one world, made once: a render system takes few lights.

    They live in a scene of their own beside the world's, so that looking changes nothing in it.
    """

    def __init__(self, world: BuiltWorld) -> None:
        """Set up the lights."""
        self._world = weakref.proxy(world)
        self._scene = sapien.Scene([world.scene.render_system])
        self._scene.set_ambient_light(list(SKY))
        self._lamps: list[Any] = [
            self._scene.add_directional_light(
                list(d), list(c), shadow=world.shadows and casts, shadow_scale=SHADOW_SIZE
            )
            for (d, c), casts in zip(LAMPS, (True, False), strict=True)
        ]
        self._cameras: dict[tuple[Any, ...], Any] = {}
        self._begun = set[Any]()  # cameras that took a picture
        self._markers = _markers(world)
        self._bodies = DrawnBodies(world)
        self._in_software = draws_in_software(world.scene.render_system.device.name)
        self._backdrops: dict[Any, Backdrop] = {}
        self._looks = AS_DECLARED  # that it has
        self._appearance: Appearance | None = None

    def look(
        self, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> Drawn:
        """Begin to take pictures with all cameras, of the same moment.

        The driver draws in threads of its own, also while other worlds' pictures are begun.
        """
        if self._world.looks is not self._looks:
            self._dress(self._world.looks)
        for marker in self._markers:
            marker.visibility = float(markers)
        placed = [self._placed(name, camera, textures) for name, camera in cameras.items()]
        self._scene.update_render()
        if not textures:
            return lambda: [_view(shot, {}) for shot in placed]
        # A graphics card draws everything sooner than backdrops are laid behind what moves.
        layered = self._in_software and all(shot.shaders == LAYERED for shot in placed)
        if markers or not layered or not self._bodies.solid or self._world.shadows:
            return self._whole(placed)
        return self._layered(placed)

    def wait(self) -> None:
        """Wait until everything that was begun is drawn."""
        for camera in self._begun:
            camera.get_picture(COLOR)

    def _take(self, camera: Any) -> None:
        self._begun.add(camera)
        camera.take_picture()

    def _whole(self, placed: Sequence[_PlacedCamera]) -> Drawn:
        """Begin to take pictures of everything at once."""
        self._bodies.show_all()
        for shot in placed:
            self._take(shot.camera)
        return lambda: [_view(shot, shot.pictures()) for shot in placed]

    def _layered(self, placed: Sequence[_PlacedCamera]) -> Drawn:
        """Begin to take pictures of what each camera may see.

        Those of cameras that stand still show only what moves; what does not comes behind it.
        """
        standing = [shot.camera for shot in placed if not shot.rides]
        backdrops = self._backdrops_of(standing)
        self._bodies.show_moving([backdrop.planes for backdrop in backdrops.values()])
        for camera in standing:
            self._take(camera)
        for shot in placed:
            if shot.rides:
                self._bodies.show_seen(planes(shot.camera))
                self._take(shot.camera)

        def views() -> list[View]:
            found: list[View] = []
            for shot in placed:
                backdrop = backdrops.get(shot.camera)
                images = backdrop.behind(shot.camera, shot.images) if backdrop else shot.pictures()
                found += self._whole([shot])() if images is None else [_view(shot, images)]
            return found

        return views

    def _backdrops_of(self, cameras: Sequence[Any]) -> dict[Any, Backdrop]:
        poses = self._bodies.still_poses()
        for camera in cameras:
            backdrop = self._backdrops.get(camera)
            if backdrop is None or not backdrop.fits(camera, poses):
                self._bodies.show_still()
                self._take(camera)
                self._backdrops[camera] = Backdrop(camera, poses)
        return {camera: self._backdrops[camera] for camera in cameras}

    def _placed(self, name: str, camera: AnyCamera, textures: Sequence[str]) -> _PlacedCamera:
        lens, intrinsic = lens_of(camera), camera.intrinsic
        shaders = shaders_of(camera, textures)
        key = shaders, name, lens.width, lens.height, lens.fov, lens.near, lens.far, intrinsic
        if key not in self._cameras:
            self._cameras[key] = self._add_camera(*key)
        placed = self._cameras[key]
        if on := ridden(camera):
            robot, link = on
            placed.entity.set_pose(self._world.robots[robot].link(link).entity_pose)
        pose = _local_pose(camera)
        shift = self._looks.cameras.get(camera_name(camera))
        placed.local_pose = pose if shift is None else shifted(pose, shift)
        if shift is not None:
            seen = field_of_view(camera)
            wide = widened(seen, shift)
            if intrinsic is None:
                placed.set_fovy(wide, compute_x=True)
            else:
                zoom = tan(seen / 2) / tan(wide / 2)
                placed.set_focal_lengths(intrinsic[0][0] * zoom, intrinsic[1][1] * zoom)
        return _PlacedCamera(placed, shaders, told_by(camera, textures), on is not None)

    def _dress(self, looks: Looks) -> None:
        """Let everything look as it is to from now on."""
        self._looks = looks
        self._bodies.show_all()
        if looks.patterns or looks.paints:
            if self._appearance is None:
                self._appearance = Appearance(self._world)
            self._appearance.dress(looks)
            self._markers = _markers(self._world)
        *names, everywhere = LIGHTS
        for name, lamp, (direction, color) in zip(names, self._lamps, LAMPS, strict=True):
            if glow := looks.lights.get(name):
                lamp.color = light_color(color, glow)
                lamp.entity.set_pose(lamp_pose(direction, glow))
        if glow := looks.lights.get(everywhere):
            self._scene.set_ambient_light(light_color(SKY, glow))
        self._bodies, self._backdrops = DrawnBodies(self._world), {}

    def _add_camera(self, shaders: str, *key: Any) -> Any:
        # Process-wide, bound when a camera is made; others in this process may have changed them.
        sapien.render.set_camera_shader_dir("rt" if shaders in RAY_TRACING else shaders)
        for image, pixels in _FORMATS.get(shaders, {}).items():
            sapien.render.set_picture_format(image, pixels)
        if rays := RAY_TRACING.get(shaders):
            sapien.render.set_ray_tracing_samples_per_pixel(rays[0])
            sapien.render.set_ray_tracing_path_depth(rays[1])
            sapien.render.set_ray_tracing_denoiser("optix")
        *lens, intrinsic = key
        camera = self._scene.add_camera(*lens)
        if shaders not in RAY_TRACING:
            camera.set_texture(*_no_reflections())
        if intrinsic is not None:
            (fx, _, cx), (_, fy, cy), _ = intrinsic
            camera.set_focal_lengths(fx, fy)
            camera.set_principal_point(cx, cy)
        return camera


def _no_reflections() -> tuple[str, Any]:
    """Return the name and the pixels of a table of how surfaces reflect what surrounds a scene.

    That is black here, so no picture depends on the table; but a process in which a camera has none
    of its own computes it before its first picture, which takes a software driver 8 s of a core.
    """
    black = np.zeros((1, 1, 4), np.float32)
    return "BRDFLUT", sapien.render.RenderTexture(black, 2, "R32G32B32A32Sfloat")


class _PlacedCamera(NamedTuple):
    """A camera of SAPIEN's in its place, and what is taken with it.

    Attributes:
        camera: The camera.
        shaders: Which of `SHADERS` draw its pictures.
        textures: What it tells.
        rides: Whether it rides on a link.
    """

    camera: Any
    shaders: str
    textures: tuple[str, ...]
    rides: bool

    @property
    def images(self) -> set[str]:
        """Names of the images that its textures are taken from."""
        return {_PIXELS[self.shaders][texture][0] for texture in self.textures}

    def pictures(self) -> dict[str, NDArray[Any]]:
        """Return these images; waits until they are drawn."""
        return {name: self.camera.get_picture(name) for name in self.images}


def _markers(world: BuiltWorld) -> list[Any]:
    return [
        body.entity.find_component_by_type(sapien.render.RenderBodyComponent)
        for body in world.bodies.values()
        if body.declared.marker
    ]


def _view(shot: _PlacedCamera, images: Mapping[str, NDArray[Any]]) -> View:
    taken = ((texture, *_PIXELS[shot.shaders][texture]) for texture in shot.textures)
    return View(
        {texture: values(images[image]) for texture, image, values in taken},
        shot.camera.get_extrinsic_matrix(),
        shot.camera.get_model_matrix(),
        shot.camera.get_intrinsic_matrix(),
    )


def _local_pose(camera: AnyCamera) -> sapien.Pose:
    """Return a camera's pose in the world or, if it rides, in the link's frame."""
    if isinstance(camera, RobotCamera):
        return sapien.Pose(list(camera.mount.position), list(camera.mount.quaternion))
    if camera.target is not None:
        return look_at(camera.eye, camera.target)
    return sapien.Pose(list(camera.eye), list(camera.quaternion or ()))


def _scaled(image: NDArray[Any], factor: int, dtype: torch.dtype) -> NDArray[Any]:
    """Return three channels in integers; torch's conversion, as what does not fit is undefined."""
    return (torch.from_numpy(image)[..., :3] * factor).to(dtype).numpy()


def look_at(eye: Vector3, target: Vector3) -> sapien.Pose:
    """Return the pose of a camera at ``eye`` that looks at ``target`` with z up (m, world).

    A camera looks along its own +x, with +z up. Float32, in the order of native's own operations.

    Raises:
        SimulationError: If the two points coincide.
    """
    start, end = torch.tensor([eye, target], dtype=torch.float32)
    if torch.equal(start, end):
        raise SimulationError(f"a camera at {eye} cannot look at the point where it is")
    forward = _unit((end - start)[None])
    up = torch.tensor([[0.0, 0.0, 1.0]])
    if torch.linalg.vector_norm(torch.linalg.cross(up, forward)) < 1e-6:
        up = torch.tensor([[1.0, 0.0, 0.0]])  # straight down or up: +x is up in the picture
    left = _unit(torch.linalg.cross(up, forward))
    axes = torch.stack([forward, left, torch.linalg.cross(forward, left)], dim=-1)
    return sapien.Pose(start.tolist(), list(map(float, quaternion(*axes[0].numpy()))))


def _unit(rows: torch.Tensor) -> torch.Tensor:
    return rows / torch.linalg.vector_norm(rows, dim=-1, keepdim=True)
