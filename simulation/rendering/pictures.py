"""Pictures of worlds, all lit alike, and whether this machine can draw any."""

from __future__ import annotations

import functools
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import sapien
import torch
from numpy.typing import NDArray

from robots import SimulationError
from robots.descriptor import Vector3
from simulation.rendering.cameras import Camera, RobotCamera
from simulation.rendering.device import expect_render_device
from simulation.rotations import quaternion
from simulation.simulation import Simulation
from simulation.world import World

SIZE = 512  # pixels along each side of a picture for people
FIELD_OF_VIEW = 1.0  # rad, vertical

# mani_skill 3.0.1, envs/sapien_env.py, _load_lighting: red, green, blue; directions point away
# from the lamp.
SKY = (0.3, 0.3, 0.3)
LAMPS = (((1.0, 1.0, -1.0), (1.0, 1.0, 1.0)), ((0.0, 0.0, -1.0), (1.0, 1.0, 1.0)))

# mani_skill 3.0.1, render/shaders.py, "minimal": what each image holds
_SHADERS = "minimal"
_FORMATS = {"Color": "r8g8b8a8unorm", "PositionSegmentation": "r16g16b16a16sint"}
_IMAGES = {
    "rgb": "Color",
    "depth": "PositionSegmentation",
    "segmentation": "PositionSegmentation",
    "position": "PositionSegmentation",
}

_PROBE = "import sapien; from sapien.render import RenderSystem; sapien.Scene([RenderSystem()])"
_PROBE_SECONDS = 60

Texture = NDArray[np.uint8] | NDArray[np.int16]  # (H, W, 3) or (H, W, 1)


class Cameras:
    """One camera per world, all looking from the same place at the same point, for people.

    Cameras and lights live in a scene of their own beside each world's, so that looking at a
    world changes nothing in it.
    """

    def __init__(self, simulation: Simulation, eye: Vector3, target: Vector3) -> None:
        """Set a camera up in every world.

        Args:
            simulation: Worlds that were built with visuals.
            eye: Where the cameras are (m, world).
            target: The point in the middle of the picture (m, world).

        Raises:
            SimulationError: If the worlds have no visuals, or ``eye`` and ``target`` coincide.
        """
        _expect_visuals(simulation)
        self._simulation = simulation
        self._view = Camera(eye, target, "view", SIZE, SIZE, FIELD_OF_VIEW)

    def take(self) -> NDArray[np.uint8]:
        """Return what every camera sees now, (N, 512, 512, 3).

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        expect_render_device()
        pictures: list[Texture] = []
        for world in self._simulation.worlds:
            (view,) = _studio(world).look({"view": self._view}, ("rgb",), markers=True)
            pictures.append(view.images["rgb"])
        return np.stack(pictures).astype(np.uint8, copy=False)


@dataclass(frozen=True)
class View:
    """What one camera tells of one world.

    Attributes:
        images: Texture → image: ``rgb`` (H, W, 3) uint8, ``depth`` (H, W, 1) int16 (mm),
            ``segmentation`` (H, W, 1) int16, ``position`` (H, W, 3) int16 (mm).
        extrinsic_cv: World to camera, which looks along +z with y down, (3, 4).
        cam2world_gl: Camera, which looks along -z with y up, to world, (4, 4).
        intrinsic_cv: Camera to pixels, (3, 3).
    """

    images: dict[str, Texture]
    extrinsic_cv: NDArray[np.float32]
    cam2world_gl: NDArray[np.float32]
    intrinsic_cv: NDArray[np.float32]


class Observers:
    """The cameras that observe: in every world the same ones, which do not see its markers."""

    def __init__(
        self,
        simulation: Simulation,
        cameras: Mapping[str, Camera | RobotCamera],
        textures: Sequence[str],
    ) -> None:
        """Remember what to look with; cameras are set up when a world is first looked at.

        Args:
            simulation: Worlds that were built with visuals.
            cameras: Camera by its name in observations.
            textures: What to take, some of `simulation.rendering.cameras.TEXTURES`.

        Raises:
            SimulationError: If the worlds have no visuals.
            UnknownNameError: If a robot has not the link that its camera rides on.
        """
        _expect_visuals(simulation)
        self._simulation, self._cameras, self._textures = simulation, dict(cameras), tuple(textures)
        for camera in self._cameras.values():
            if isinstance(camera, RobotCamera):
                simulation.worlds[0].robots[camera.robot].link(camera.mount.link)

    def look(self, env: int) -> dict[str, View]:
        """Return what every camera sees in one world now, by its name.

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        expect_render_device()
        studio = _studio(self._simulation.worlds[env])
        views = studio.look(self._cameras, self._textures, markers=False)
        return dict(zip(self._cameras, views, strict=True))


class _Studio:
    """The cameras and the lights of one world, made once: a render system takes few lights."""

    def __init__(self, world: World) -> None:
        self._world = weakref.proxy(world)
        self._scene = sapien.Scene([world.scene.render_system])
        self._scene.set_ambient_light(list(SKY))
        for direction, color in LAMPS:
            self._scene.add_directional_light(list(direction), list(color))
        self._cameras: dict[tuple[Any, ...], Any] = {}
        self._markers: list[Any] = [
            body.entity.find_component_by_type(sapien.render.RenderBodyComponent)
            for body in world.bodies.values()
            if body.marker
        ]

    def look(
        self, cameras: Mapping[str, Camera | RobotCamera], textures: Sequence[str], *, markers: bool
    ) -> list[View]:
        """Take pictures with all cameras at the same moment."""
        for marker in self._markers:
            marker.visibility = float(markers)
        placed = [self._placed(name, camera) for name, camera in cameras.items()]
        self._scene.update_render()
        for camera in placed:
            camera.take_picture()
        return [_view(camera, textures) for camera in placed]

    def _placed(self, name: str, camera: Camera | RobotCamera) -> Any:
        lens = camera.mount if isinstance(camera, RobotCamera) else camera
        key = name, lens.width, lens.height, lens.fov, lens.near, lens.far
        if key not in self._cameras:
            self._cameras[key] = self._add_camera(*key)
        placed = self._cameras[key]
        if isinstance(camera, RobotCamera):
            link = self._world.robots[camera.robot].link(camera.mount.link)
            mount = camera.mount
            placed.entity.set_pose(link.entity_pose)
            placed.local_pose = sapien.Pose(list(mount.position), list(mount.quaternion))
        else:
            placed.local_pose = look_at(camera.eye, camera.target)
        return placed

    def _add_camera(
        self, name: str, width: int, height: int, fov: float, near: float, far: float
    ) -> Any:
        # Process-wide, bound when a camera is made; others in this process may have changed them.
        sapien.render.set_camera_shader_dir(_SHADERS)
        for image, pixels in _FORMATS.items():
            sapien.render.set_picture_format(image, pixels)
        return self._scene.add_camera(name, width, height, fov, near, far)


def _view(camera: Any, textures: Sequence[str]) -> View:
    found = {image: camera.get_picture(image) for image in {_IMAGES[t] for t in textures}}
    pixels = {texture: found[_IMAGES[texture]] for texture in textures}
    channels = {
        "rgb": lambda x: x[..., :3],
        "depth": lambda x: -x[..., 2:3],
        "segmentation": lambda x: x[..., 3:],
        "position": lambda x: x[..., :3],
    }
    return View(
        {texture: channels[texture](x) for texture, x in pixels.items()},
        camera.get_extrinsic_matrix(),
        camera.get_model_matrix(),
        camera.get_intrinsic_matrix(),
    )


_studios: WeakKeyDictionary[World, _Studio] = WeakKeyDictionary()


def _studio(world: World) -> _Studio:
    if world not in _studios:
        _studios[world] = _Studio(world)
    return _studios[world]


def _expect_visuals(simulation: Simulation) -> None:
    if not all(world.visuals for world in simulation.worlds):
        raise SimulationError("these worlds have nothing to draw; build them with visuals=True")


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
    return sapien.Pose(start.tolist(), quaternion(axes[0]).tolist())


def _unit(rows: torch.Tensor) -> torch.Tensor:
    return rows / torch.linalg.vector_norm(rows, dim=-1, keepdim=True)


@functools.cache
def vulkan_problem() -> str | None:
    """Say in a few words why no pictures can be drawn on this machine, or return None.

    Tried once, in a process of its own, as some drivers end the process that asks them.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE],
            capture_output=True,
            text=True,
            check=False,
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"the Vulkan driver did not answer within {_PROBE_SECONDS} s"
    if done.returncode == 0:
        return None
    lines = done.stderr.strip().splitlines()
    last = lines[-1] if lines else f"the process ended with code {done.returncode}"
    return f"no usable Vulkan driver ({last})"
