"""Cameras as data: where they are, what they see, and what pictures they take."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import (
    FAR,
    checked_choice,
    checked_number,
    checked_numbers,
    checked_whole,
    expect_unit,
    shown,
)
from robots import RobotLayoutsError, SimulationError
from robots.descriptor import CameraMount, Quaternion, Vector3

TEXTURES = ("rgb", "depth", "segmentation", "position", "normal", "albedo")
"""What a camera can tell of each pixel, in ManiSkill's words: colour, distance along the view (mm),
number of the body or link, place in the camera's frame (mm), direction of the surface in that
frame, colour without light."""

RAW = "raw"
"""In place of textures: the images from which they are taken, all four channels of each."""

# mani_skill 3.0.1, render/shaders.py: rays per pixel, and how often each is reflected
RAY_TRACING = {"rt": (32, 16), "rt-med": (4, 3), "rt-fast": (2, 1)}
# Likewise: what each pack of shaders tells, in native's order
SHADERS = {
    "minimal": ("rgb", "position", "depth", "segmentation"),
    **dict.fromkeys(
        ("default", *RAY_TRACING),
        ("rgb", "depth", "position", "segmentation", "normal", "albedo"),
    ),
}
RAW_IMAGES = {
    "minimal": ("Color", "PositionSegmentation"),
    **dict.fromkeys(("default", *RAY_TRACING), ("Color", "Position", "Segmentation")),
}
"""What cameras tell of `RAW`, by their shaders."""

Intrinsic = tuple[Vector3, Vector3, Vector3]
"""Camera to pixels, by rows: ((fx, 0, cx), (0, fy, cy), (0, 0, 1))."""

DEFAULT_FOV = math.pi / 2  # rad, vertical, unless another is declared
SIZE = 512  # pixels along each side of a picture for people
FIELD_OF_VIEW = 1.0  # rad, vertical, of such a picture

_MOST_PIXELS = 16384  # of a side; what graphics drivers draw at most
_NARROW = 1e-3  # rad, between a field of view and none or a half-turn
_NEAR = 1e-6  # m


@dataclass(frozen=True)
class Camera:
    """A camera that observes: it stands still, or rides on a link.

    Attributes:
        eye: Where it is (m), in the world or, if it rides, in the link's frame.
        target: The point in the middle of its picture (m), likewise; z is up there.
        name: Its name in observations.
        width: Image width (pixels).
        height: Image height (pixels).
        fov: Vertical field of view (rad).
        near: Near plane (m).
        far: Far plane (m).
        quaternion: How it is turned, wxyz, in place of ``target``; it looks along its +x, z up.
        mount: A robot in the layout and the link of it that it rides on; None: it stands still.
        intrinsic: Camera to pixels, (3, 3), in place of ``fov``.
        shader: Which of `SHADERS` draw its pictures; None: the first that tell what is asked for.
    """

    eye: Vector3
    target: Vector3 | None = None
    name: str = "base_camera"
    width: int = 128
    height: int = 128
    fov: float = DEFAULT_FOV
    near: float = 0.01
    far: float = 100.0
    quaternion: Quaternion | None = None
    mount: tuple[str, str] | None = None
    intrinsic: Intrinsic | None = None
    shader: str | None = None

    def __post_init__(self) -> None:
        """Refuse a camera that can take no picture.

        Raises:
            SimulationError: If it looks at where it is, or a size or angle is invalid.
        """
        if not isinstance(self.name, str):
            raise SimulationError(f"a camera's name is {shown(self.name)}; it must be text")
        self._set("eye", checked_numbers, 3, FAR, unit="m")
        if (self.target is None) == (self.quaternion is None):
            raise SimulationError(
                f"{self.name} has {'neither' if self.target is None else 'both'} target and"
                " quaternion; it needs one of them"
            )
        if self.quaternion is not None:
            self._set("quaternion", checked_numbers, 4, FAR)
            expect_unit(f"{self.name}: quaternion", self.quaternion, SimulationError)
        else:
            self._set("target", checked_numbers, 3, FAR, unit="m")
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
        if self.intrinsic is not None and self.fov != DEFAULT_FOV:
            raise SimulationError(f"{self.name} has both fov and intrinsic; it takes one of them")
        if self.mount is not None:
            object.__setattr__(self, "mount", checked_mount(f"{self.name}: mount", self.mount))
        _check_picture(self, self.name)

    def _set(self, field: str, checked: Callable[..., object], *bounds: float, **unit: str) -> None:
        value = checked(
            f"{self.name}: {field}", getattr(self, field), *bounds, error=SimulationError, **unit
        )
        object.__setattr__(self, field, value)


@dataclass(frozen=True)
class RobotCamera:
    """A camera that a robot of a layout brings with it.

    Attributes:
        robot: The robot's name in the layout.
        mount: Where on the robot it is, and what it sees.
        intrinsic: See `Camera`; in place of the mount's ``fov``.
        shader: See `Camera`.
    """

    robot: str
    mount: CameraMount
    intrinsic: Intrinsic | None = None
    shader: str | None = None

    def __post_init__(self) -> None:
        """Refuse what no camera can be.

        Raises:
            SimulationError: If the intrinsic matrix or the shaders are invalid.
        """
        _check_picture(self, camera_name(self))


AnyCamera = Camera | RobotCamera


def _check_picture(camera: AnyCamera, name: str) -> None:
    """Refuse unknown shaders and matrices that are not intrinsic; keep the matrix by rows."""
    if camera.shader is not None:
        checked_choice(f"{name}: shader", camera.shader, tuple(SHADERS), SimulationError)
    if camera.intrinsic is not None:
        rows = checked_intrinsic(f"{name}: intrinsic", camera.intrinsic)
        object.__setattr__(camera, "intrinsic", rows)


def checked_intrinsic(what: str, value: Any) -> Intrinsic:
    """Return an intrinsic matrix by rows.

    Raises:
        SimulationError: If it is not one.
    """
    try:
        rows = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        rows = np.empty(0)
    if rows.shape == (3, 3) and np.isfinite(rows).all() and np.abs(rows).max() <= FAR:
        (fx, skew, _), (below, fy, _), last = rows.tolist()
        if fx > 0 and fy > 0 and skew == below == 0 and last == [0, 0, 1]:
            first, second, third = (tuple(row) for row in rows.tolist())
            return first, second, third
    raise SimulationError(
        f"{what} is {shown(value)}; it must be ((fx, 0, cx), (0, fy, cy), (0, 0, 1)) in pixels,"
        " with fx and fy above 0"
    )


def checked_mount(
    what: str, value: Any, error: type[RobotLayoutsError] = SimulationError
) -> tuple[str, str]:
    """Return what a camera rides on: a robot in the layout, and a link.

    Raises:
        RobotLayoutsError: ``error``, if it is not two names.
    """
    given = tuple(value) if isinstance(value, (tuple, list)) else ()
    if len(given) == 2 and all(isinstance(name, str) for name in given):
        return given
    raise error(
        f"{what} is {shown(value)}; a robot in the layout and a link of it are needed, such as"
        " ('arm', 'panda_hand')"
    )


def camera_name(camera: AnyCamera) -> str:
    """Return a camera's name; of one that a robot brings, after the robot's: ``left.hand``."""
    if isinstance(camera, RobotCamera):
        return f"{camera.robot}.{camera.mount.name}"
    return camera.name


def ridden(camera: AnyCamera) -> tuple[str, str] | None:
    """Return the robot and the link that a camera rides on; None if it stands still."""
    if isinstance(camera, RobotCamera):
        return camera.robot, camera.mount.link
    return camera.mount


def lens_of(camera: AnyCamera) -> Camera | CameraMount:
    """Return what has a camera's width, height, fov, near and far plane."""
    return camera.mount if isinstance(camera, RobotCamera) else camera


def field_of_view(camera: AnyCamera) -> float:
    """Return a camera's vertical field of view (rad), as if it looked through the middle."""
    lens = lens_of(camera)
    if camera.intrinsic is None:
        return lens.fov
    return 2 * math.atan2(lens.height / 2, camera.intrinsic[1][1])


def shaders_for(textures: Iterable[str]) -> str:
    """Return the first of `SHADERS` that tells all of this; one of them does."""
    wanted = {*textures} - {RAW}
    return next(pack for pack, told in SHADERS.items() if wanted.issubset(told))


def shaders_of(camera: AnyCamera, textures: Iterable[str]) -> str:
    """Return which of `SHADERS` draw a camera's pictures."""
    return camera.shader or shaders_for(textures)


def told_by(camera: AnyCamera, textures: Iterable[str]) -> tuple[str, ...]:
    """Return what a camera tells of textures, in native's order; images by name of `RAW`.

    Raises:
        SimulationError: If its shaders do not tell all of it.
    """
    wanted, pack = {*textures}, shaders_of(camera, textures)
    if RAW in wanted:
        return RAW_IMAGES[pack]
    if lacking := sorted(wanted.difference(SHADERS[pack])):
        raise SimulationError(
            f"{camera_name(camera)} is drawn by the shaders {pack!r}, which tell no"
            f" {', '.join(lacking)}; {shaders_for(wanted)!r} do"
        )
    return tuple(texture for texture in SHADERS[pack] if texture in wanted)


Texture = NDArray[Any]  # (H, W, k)


@dataclass(frozen=True)
class View:
    """What one camera tells of one world.

    Attributes:
        images: Texture → image: ``rgb`` and ``albedo`` (H, W, 3) uint8, ``depth`` (H, W, 1) int16
            (mm), ``position`` (H, W, 3) int16 (mm), ``normal`` (H, W, 3) float32, ``segmentation``
            (H, W, 1) int16, or int64 by the shaders ``default``; of `RAW` (H, W, 4), as the shaders
            store them.
        extrinsic_cv: World to camera, which looks along +z with y down, (3, 4).
        cam2world_gl: Camera, which looks along -z with y up, to world, (4, 4).
        intrinsic_cv: Camera to pixels, (3, 3).
    """

    images: dict[str, Texture]
    extrinsic_cv: NDArray[np.float32]
    cam2world_gl: NDArray[np.float32]
    intrinsic_cv: NDArray[np.float32]
