"""Where a camera is to be so that all that matters just fits into its picture."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, tan

import numpy as np
from numpy.typing import NDArray

from robots.descriptor import Vector3
from simulation import Camera

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]  # (H, W, 3)

BACKGROUND = (238, 241, 245)  # red, green, blue of what is empty
TEXTURES = ("rgb", "segmentation", "position")


@dataclass(frozen=True)
class Lens:
    """From which side a camera looks, and what it takes in.

    Attributes:
        azimuth: Where it is, seen from what it looks at, about z from +x (rad).
        elevation: How high over the horizon (rad).
        fov: Its vertical field of view (rad).
        aspect: Width of its picture / height.
        margin: Share of the picture that stays empty on each side.
    """

    azimuth: float
    elevation: float
    fov: float
    aspect: float = 1.0
    margin: float = 0.06

    def axes(self) -> Floats:
        """Return what is to the right, up and ahead in its picture, (3, 3), a row each."""
        level = cos(self.elevation)
        ahead = -np.array(
            [level * cos(self.azimuth), level * sin(self.azimuth), sin(self.elevation)]
        )
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(right, ahead), ahead])

    def fitted(self, points: Floats) -> Floats:
        """Return where it is to be, as near as may be, so that it sees points (m, world).

        A point at (x, y) and depth z is in its picture if it is moved by (u, v) and w ahead, and
        |x - u| and |y - v| are at most (z - w) tan(fov / 2).

        Args:
            points: Shape (P, 3), P of 1 or more.
        """
        x, y, z = self.axes() @ points.T
        slope = tan(self.fov / 2) * (1 - 2 * self.margin)
        right, far = _centred(x, z, slope * self.aspect)
        up, farther = _centred(y, z, slope)
        return np.array([right, up, min(far, farther)]) @ self.axes()

    def camera(self, eye: Floats, height: int) -> Camera:
        """Return the camera at a place (m, world), with pictures of so many pixels' height."""
        target = eye + self.axes()[2]
        width = round(height * self.aspect)
        return Camera(_point(eye), _point(target), f"gallery {height}", width, height, self.fov)


def shrunk(rgb: NDArray[np.uint8], solid: NDArray[np.bool_], samples: int) -> Picture:
    """Return a picture of fewer pixels, each the mean of a square of them.

    Args:
        rgb: Shape (H, W, 3).
        solid: What is not background, (H, W, 1).
        samples: Pixels along each side of the square.
    """
    fine = np.where(solid, rgb, BACKGROUND)
    height, width = (n // samples for n in fine.shape[:2])
    blocks = fine.reshape(height, samples, width, samples, 3)
    return np.round(blocks.mean((1, 3))).astype(np.uint8)


def _centred(across: Floats, depth: Floats, slope: float) -> tuple[float, float]:
    """Return how far a camera is to move sideways, and may move ahead."""
    low, high = (across - slope * depth).max(), (across + slope * depth).min()
    return float((low + high) / 2), float((high - low) / (2 * slope))


def _point(place: Floats) -> Vector3:
    x, y, z = place.tolist()
    return x, y, z
