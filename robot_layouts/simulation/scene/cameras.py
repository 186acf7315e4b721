"""Cameras as data: where they are, what they see, and what pictures they take."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import FAR, checked_number, checked_numbers, checked_whole, shown
from robots import SimulationError
from robots.descriptor import CameraMount, Vector3

TEXTURES = ("rgb", "depth", "segmentation", "position", "normal", "albedo")
"""What a camera can tell of each pixel, in ManiSkill's words: colour, distance along the view (mm),
number of the body or link, place in the camera's frame (mm), direction of the surface in that
frame, colour without light."""

RAW = ("Color", "PositionSegmentation")
"""The images from which the quick shaders' pixels are taken, all four channels of each."""

# mani_skill 3.0.1, render/shaders.py: what each pack of shaders tells, in native's order
SHADERS = {
    "minimal": ("rgb", "position", "depth", "segmentation", *RAW),
    "default": ("rgb", "depth", "position", "segmentation", "normal", "albedo"),
}

_MOST_PIXELS = 16384  # of a side; what graphics drivers draw at most
_NARROW = 1e-3  # rad, between a field of view and none or a half-turn
_NEAR = 1e-6  # m


@dataclass(frozen=True)
class Camera:
    """A camera that stands still and observes.

    Attributes:
        eye: Where it is (m, world).
        target: The point in the middle of its picture (m, world).
        name: Its name in observations.
        width: Image width (pixels).
        height: Image height (pixels).
        fov: Vertical field of view (rad).
        near: Near plane (m).
        far: Far plane (m).
    """

    eye: Vector3
    target: Vector3
    name: str = "base_camera"
    width: int = 128
    height: int = 128
    fov: float = math.pi / 2
    near: float = 0.01
    far: float = 100.0

    def __post_init__(self) -> None:
        """Refuse a camera that can take no picture.

        Raises:
            SimulationError: If it looks at where it is, or a size or angle is invalid.
        """
        if not isinstance(self.name, str):
            raise SimulationError(f"a camera's name is {shown(self.name)}; it must be text")
        for field in ("eye", "target"):
            self._set(field, checked_numbers, 3, FAR, unit="m")
        if self.eye == self.target:
            raise SimulationError(f"a camera at {self.eye} cannot look at the point where it is")
        for field in ("width", "height"):
            self._set(field, checked_whole, 1, _MOST_PIXELS)
        self._set("fov", checked_number, _NARROW, math.pi - _NARROW, unit="rad")
        for field in ("near", "far"):
            self._set(field, checked_number, _NEAR, FAR, unit="m")
        if not self.near < self.far:
            raise SimulationError(
                f"{self.name}: near is {self.near} m, far {self.far} m; they must be 0 < near < far"
            )

    def _set(self, field: str, checked: Callable[..., object], *bounds: float, **unit: str) -> None:
        value = checked(
            f"{self.name}: {field}", getattr(self, field), *bounds, error=SimulationError, **unit
        )
        object.__setattr__(self, field, value)


@dataclass(frozen=True)
class RobotCamera:
    """A camera that rides on a robot of a layout.

    Attributes:
        robot: The robot's name in the layout.
        mount: Where on the robot it is, and what it sees.
    """

    robot: str
    mount: CameraMount


AnyCamera = Camera | RobotCamera


def camera_name(camera: AnyCamera) -> str:
    """Return a camera's name; of one that rides on a robot, after the robot's: ``left.hand``."""
    if isinstance(camera, RobotCamera):
        return f"{camera.robot}.{camera.mount.name}"
    return camera.name


def shaders_for(textures: Iterable[str]) -> str:
    """Return the first of `SHADERS` that tells all of this; one of them does."""
    wanted = set(textures)
    return next(pack for pack, told in SHADERS.items() if wanted.issubset(told))


Texture = NDArray[Any]  # (H, W, k)


@dataclass(frozen=True)
class View:
    """What one camera tells of one world.

    Attributes:
        images: Texture → image: ``rgb`` and ``albedo`` (H, W, 3) uint8, ``depth`` (H, W, 1) int16
            (mm), ``position`` (H, W, 3) int16 (mm), ``normal`` (H, W, 3) float32, ``segmentation``
            (H, W, 1) int16, beside a normal or an albedo int64; of `RAW` (H, W, 4) uint8 and int16.
        extrinsic_cv: World to camera, which looks along +z with y down, (3, 4).
        cam2world_gl: Camera, which looks along -z with y up, to world, (4, 4).
        intrinsic_cv: Camera to pixels, (3, 3).
    """

    images: dict[str, Texture]
    extrinsic_cv: NDArray[np.float32]
    cam2world_gl: NDArray[np.float32]
    intrinsic_cv: NDArray[np.float32]
