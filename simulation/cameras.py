"""Cameras as data: where they are, what they see, and what pictures they take."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robots import SimulationError
from robots.descriptor import CameraMount, Vector3

TEXTURES = ("rgb", "depth", "segmentation", "position")
"""What a camera can tell of each pixel, in ManiSkill's words: colour, distance along the view (mm),
number of the body or link, place in the camera's frame (mm)."""


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
            SimulationError: If it looks at where it is, or a size or angle makes no sense.
        """
        if tuple(self.eye) == tuple(self.target):
            raise SimulationError(f"a camera at {self.eye} cannot look at the point where it is")
        for name in ("width", "height"):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= 1):
                raise SimulationError(f"{self.name}: {name} is {value!r}; it must be 1 or more")
        if not 0 < self.fov < math.pi:
            raise SimulationError(f"{self.name}: fov is {self.fov} rad; it must be below π")
        if not 0 < self.near < self.far:
            raise SimulationError(
                f"{self.name}: near is {self.near} m, far {self.far} m; they must be 0 < near < far"
            )


@dataclass(frozen=True)
class RobotCamera:
    """A camera that rides on a robot of a layout.

    Attributes:
        robot: The robot's name in the layout.
        mount: Where on the robot it is, and what it sees.
    """

    robot: str
    mount: CameraMount
