"""Pictures of worlds in MuJoCo, drawn by OpenGL."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.simulation.cameras import (
    AnyCamera,
    RobotCamera,
    View,
    field_of_view,
    lens_of,
    ridden,
)
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.bodies import DRAWN, MARKERS
from robot_layouts.simulation.mujoco.world import MujocoWorld
from robots import SimulationError

_OFFERED = ("rgb", "depth", "segmentation", "position")
_MOST = np.iinfo(np.int16).max  # mm
# From a camera that looks along +x, z up, to one that looks along -z, y up.
_LOOKING = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class Pictures:
    """Draws worlds; models that are alike share what a graphics card holds of them."""

    def __init__(self) -> None:
        """Begin without anything to draw with."""
        self._renderers: dict[tuple[int, int, int], Any] = {}
        self._process = os.getpid()

    def keep(self, worlds: Sequence[MujocoWorld]) -> None:
        """Let go of what draws worlds that were built before these."""
        used = {id(world.as_built) for world in worlds}
        for key in [key for key in self._renderers if key[0] not in used]:
            self._renderers.pop(key).close()

    def look(
        self,
        world: MujocoWorld,
        cameras: Mapping[str, AnyCamera],
        textures: Sequence[str],
        *,
        markers: bool,
    ) -> list[View]:
        """Return what cameras see in a world now; see `Backend.look`.

        Raises:
            SimulationError: If this process is a fork of one that drew, nothing draws here, or
                MuJoCo does not draw one of the textures.
        """
        for texture in textures:
            if texture not in _OFFERED:
                raise SimulationError(
                    f"simulator 'mujoco' draws no {texture!r}; it draws {', '.join(_OFFERED)}"
                )
        world.update()
        mujoco.mj_camlight(world.model, world.data)
        return [self._view(world, camera, textures, markers) for camera in cameras.values()]

    def _view(
        self, world: MujocoWorld, camera: AnyCamera, textures: Sequence[str], markers: bool
    ) -> View:
        shot = _Aimed.of(world, camera)
        renderer = self._renderer(world, shot)
        options = mujoco.MjvOption()
        options.geomgroup[:] = 0
        options.geomgroup[[DRAWN, MARKERS]] = 1, int(markers)
        options.sitegroup[:] = 0
        renderer.update_scene(world.data, scene_option=options)
        for eye in renderer.scene.camera:
            shot.aim(eye)
        images = dict[str, NDArray[Any]]()
        if "rgb" in textures:
            images["rgb"] = renderer.render()
        if set(textures) - {"rgb"}:
            images |= _measured(world, renderer, shot)
        return View({t: images[t] for t in textures}, *shot.matrices())

    def _renderer(self, world: MujocoWorld, shot: _Aimed) -> Any:
        if os.getpid() != self._process:
            raise SimulationError(
                "this process is a fork of one that drew pictures, and can draw none; begin it"
                " before the first picture, or by spawning"
            )
        model = world.as_built
        key = id(model), shot.width, shot.height
        if key not in self._renderers:
            model.vis.global_.offwidth, model.vis.global_.offheight = shot.width, shot.height
            try:
                self._renderers[key] = mujoco.Renderer(model, shot.height, shot.width)
            except Exception as error:  # each library of OpenGL has its own
                raise SimulationError(
                    f"MuJoCo cannot draw here ({error}); it needs OpenGL, by EGL or OSMesa where"
                    " there is no screen: MUJOCO_GL=egl or MUJOCO_GL=osmesa chooses"
                ) from error
        model.stat.extent, model.vis.map.znear, model.vis.map.zfar = 1.0, shot.near, shot.far
        return self._renderers[key]


def _measured(world: MujocoWorld, renderer: Any, shot: _Aimed) -> dict[str, NDArray[Any]]:
    """Return depth, position and segmentation."""
    renderer.enable_segmentation_rendering()
    geoms, kinds = np.moveaxis(renderer.render(), -1, 0)
    renderer.enable_depth_rendering()
    far = renderer.render() * 1e3
    renderer.disable_depth_rendering()
    seen = kinds == mujoco.mjtObj.mjOBJ_GEOM
    bodies = np.where(seen, world.model.geom_bodyid[np.where(seen, geoms, 0)], 0)
    depth = np.where(seen, np.minimum(far, _MOST), 0.0)
    rows, columns = np.indices(depth.shape) + 0.5
    right = (columns - shot.centre[0]) / shot.focal[0] * depth
    up = (shot.centre[1] - rows) / shot.focal[1] * depth
    return {
        "depth": depth[..., None].astype(np.int16),
        "segmentation": bodies[..., None].astype(np.int16),
        "position": np.stack([right, up, -depth], -1).astype(np.int16),
    }


@dataclass(frozen=True, eq=False)
class _Aimed:
    """A camera in its place.

    Attributes:
        pose: In the world, (4, 4) (m); it looks along -z, y up.
        width: Of the picture (pixels).
        height: Likewise.
        near: Near plane (m).
        far: Far plane (m).
        focal: Focal lengths (pixels).
        centre: Where the picture's axis is in it (pixels).
    """

    pose: Floats
    width: int
    height: int
    near: float
    far: float
    focal: tuple[float, float]
    centre: tuple[float, float]

    @classmethod
    def of(cls, world: MujocoWorld, camera: AnyCamera) -> _Aimed:
        lens, intrinsic = lens_of(camera), camera.intrinsic
        if intrinsic is None:
            length = lens.height / 2 / math.tan(field_of_view(camera) / 2)
            focal, centre = (length, length), (lens.width / 2, lens.height / 2)
        else:
            (fx, _, cx), (_, fy, cy), _ = intrinsic
            focal, centre = (fx, fy), (cx, cy)
        pose = _local_pose(camera)
        if on := ridden(camera):
            body, carrier = world.index.body(*on), np.eye(4)
            carrier[:3, 3] = world.data.xpos[body]
            carrier[:3, :3] = world.data.xmat[body].reshape(3, 3)
            pose = carrier @ pose
        pose[:3, :3] = pose[:3, :3] @ _LOOKING
        return cls(pose, lens.width, lens.height, lens.near, lens.far, focal, centre)

    def aim(self, eye: Any) -> None:
        """Put one of MuJoCo's eyes where the camera is."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        eye.pos, eye.up, eye.forward = self.pose[:3, 3], self.pose[:3, 1], -self.pose[:3, 2]
        eye.frustum_near, eye.frustum_far = self.near, self.far
        eye.frustum_top = self.near * cy / fy
        eye.frustum_bottom = -self.near * (self.height - cy) / fy
        eye.frustum_center = self.near * (self.width / 2 - cx) / fx
        eye.frustum_width = self.near * self.width / 2 / fx

    def matrices(self) -> tuple[NDArray[np.float32], ...]:
        """Return extrinsic, model and intrinsic matrix, as `View` has them."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        seen = np.linalg.inv(self.pose @ np.diag([1.0, -1.0, -1.0, 1.0]))[:3]
        lens = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        return tuple(matrix.astype(np.float32) for matrix in (seen, self.pose, lens))


def _local_pose(camera: AnyCamera) -> Floats:
    """Return a camera's pose in the world or, if it rides, on its link; it looks along +x."""
    if isinstance(camera, RobotCamera):
        return pose_matrix(camera.mount.position, camera.mount.quaternion)
    if camera.target is None:
        return pose_matrix(camera.eye, camera.quaternion or ())
    forward = np.subtract(camera.target, camera.eye)
    forward = forward / np.linalg.norm(forward)
    left = np.cross((0.0, 0.0, 1.0), forward)
    if np.linalg.norm(left) < 1e-6:
        left = np.cross((1.0, 0.0, 0.0), forward)  # straight down or up: +x is up in the picture
    left = left / np.linalg.norm(left)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([forward, left, np.cross(forward, left)])
    pose[:3, 3] = camera.eye
    return pose
