"""What DrawTriangle and PushT compute of drawn shapes, with native's order of operations.

DrawTriangle's outline is points, in float64. How much of a T's outline another T covers is counted
in pixels.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.simulation.maths import (
    Array,
    Floats,
    arccos,
    by_torch,
    cos,
    sin,
    where,
    zeros,
)

POINTS_PER_SIDE = 51  # a corner and what follows it


def side_middles(side: float, height: float) -> list[tuple[float, float, float]]:
    """Return the middles of a triangle's sides in its own frame (m).

    Args:
        side: Length of a side (m).
        height: Of the sides above the frame's origin (m).
    """
    radius = (side / 2) / math.sqrt(3)
    angles = (math.pi / 2 + turn for turn in (0.0, 2 * math.pi / 3, 4 * math.pi / 3))
    return [(radius * math.cos(a), radius * math.sin(a), height) for a in angles]


def placed_corners(pose: Floats, side: float, height: float) -> Array:
    """Return the corners of triangles at ``pose`` (N, 7), (N, 3, 3) float64 (m, world).

    The rotations are float32 matrices and multiply float64 corners, as in native.

    Args:
        pose: Position (m) and quaternion (wxyz).
        side: Length of a side (m).
        height: Of the sides above the frame's origin (m).
    """
    a, b, c = np.array(side_middles(side, height))
    corners: NDArray[np.float64] = np.array([(a + c) - b, (a + b) - c, (b + c) - a])
    return _placed(pose, corners)


@by_torch
def _placed(pose: Tensor, corners: Tensor) -> Tensor:
    position, quaternion = pose.split((3, 4), dim=1)
    w, x, y, z = quaternion.unbind(1)
    scale = 2.0 / (quaternion * quaternion).sum(1)
    rows = (
        (1 - scale * (y * y + z * z), scale * (x * y - z * w), scale * (x * z + y * w)),
        (scale * (x * y + z * w), 1 - scale * (x * x + z * z), scale * (y * z - x * w)),
        (scale * (x * z - y * w), scale * (y * z + x * w), 1 - scale * (x * x + y * y)),
    )
    matrices = torch.stack([torch.stack(row, 1) for row in rows], 1).double()
    turned = torch.bmm(matrices, corners.to(pose.device).T.expand_as(matrices))
    return turned.transpose(1, 2) + position[:, None]


@by_torch
def points_along(corners: Tensor) -> Tensor:
    """Return points along the sides of triangles, (N, 153, 2) float64 (m).

    Args:
        corners: In order, (N, 3, 3) (m).
    """
    share = torch.linspace(0, 1, POINTS_PER_SIDE + 1, device=corners.device)[:-1, None]
    starts = corners[:, :, None, :2]
    ends = corners.roll(-1, 1)[:, :, None, :2]
    return (starts * (1 - share) + ends * share).reshape(len(corners), -1, 2)


@by_torch
def near(points: Tensor, places: Tensor, threshold: float) -> Tensor:
    """Tell which points are near a place, (N, P) bool.

    Args:
        points: Shape (N, P, 2) (m).
        places: Shape (N, 2) (m).
        threshold: How near (m).
    """
    return (places[:, None] - points).square().sum(2).sqrt() < threshold


# -- how much of a T's outline another T covers ----------------------------------------------------
#
# A pose is judged by itself: the product of matrices that native takes rounds differently for a
# batch. Poses that were judged are remembered, because the T lies still most of the time.

RESOLUTION = 64  # pixels along each side of the picture
PICTURE_HALF_WIDTH = 0.15  # m
CENTRE_OF_MASS_Y = 0.0375  # of the T, above the bar's centre (m)


def yaw(quaternion: Floats) -> Floats:
    """Angle about z in [0, 2π] of wxyz quaternions (N, 4) that turn about z only, (N,) (rad)."""
    w, z = quaternion[:, 0], quaternion[:, 3]
    return 2.0 * arccos(where(z < 0, -w, w))


def cover(pose: Floats, goal: tuple[float, float, float], candidates: Array) -> Floats:
    """Return the share of an outline that each T covers.

    Args:
        pose: Poses of the T's, (N, 7) (m, wxyz).
        goal: x, y (m) and yaw (rad) of the outline.
        candidates: Which are judged, (N,) bool; the others get 0.

    Returns:
        Shape (N,), from 0 to 1.
    """
    shares = zeros(pose[:, 0])
    for i, judged in enumerate(candidates.tolist()):
        if judged:
            shares[i] = _cover(tuple(pose[i].tolist()), goal)
    return shares


@lru_cache(maxsize=1024)
def _cover(pose: tuple[float, ...], goal: tuple[float, float, float]) -> float:
    """Share of the outline that a T at ``pose`` covers.

    The T's own pixels are drawn into the outline's frame; what falls outside the picture is drawn
    into its corner.
    """
    x, y, _, *quaternion = pose
    tee_to_world = _planar_transform(yaw(np.array([quaternion], np.float32)), x, y)
    tee_to_goal = (_world_to_goal(*goal) @ tee_to_world[None])[0]
    centres = (tee_to_goal @ _CENTRES).numpy().take(_TEE_PIXELS, 1)[:2]
    scale = np.float32(RESOLUTION / 2 / PICTURE_HALF_WIDTH)
    pixels = (centres * scale + np.float32(RESOLUTION / 2)).astype(np.int64)
    inside = ((pixels >= 0) & (pixels < RESOLUTION)).all(0)
    drawn = np.zeros((RESOLUTION, RESOLUTION), bool)
    drawn[tuple(pixels * inside)] = True
    return float(np.float32((drawn & _OUTLINE).sum()) / np.float32(_OUTLINE.sum()))


@lru_cache
def _world_to_goal(x: float, y: float, turn: float) -> torch.Tensor:
    x, y = torch.tensor((x, y)).tolist()  # as float32 rounds them
    angle = np.array([turn], np.float32)
    # Native reads the angle off the outline's quaternion.
    return torch.linalg.inv(_planar_transform(2.0 * arccos(cos(angle / 2.0)), x, y))


def _planar_transform(yaw: Floats, x: float, y: float) -> torch.Tensor:
    """Homogeneous 3 × 3 matrix of a rotation about z (rad, one number) and a shift (m)."""
    cosine, sine = cos(yaw).item(), sin(yaw).item()
    return torch.tensor([[cosine, -sine, x], [sine, cosine, y], [0.0, 0.0, 1.0]])


def _outline() -> NDArray[np.bool_]:
    """The T as pixels (x, y) of its own frame, (64, 64)."""
    half, scale = RESOLUTION / 2, RESOLUTION / 2 / PICTURE_HALF_WIDTH
    picture = np.zeros((RESOLUTION, RESOLUTION), bool)
    corners = torch.tensor([[[-0.1, -0.025], [0.1, 0.025]], [[-0.025, 0.025], [0.025, 0.175]]])
    corners[..., 1] -= CENTRE_OF_MASS_Y
    for (left, bottom), (right, top) in (corners * scale + half).long().tolist():
        picture[left:right, bottom:top] = True
    return picture


def _pixel_centres() -> torch.Tensor:
    """Homogeneous coordinates of the centres of all pixels, (3, 4096) (m), from the top row on."""
    line = torch.arange(RESOLUTION, dtype=torch.float32) - RESOLUTION / 2
    x = line.expand(RESOLUTION, RESOLUTION)
    metres = (torch.stack([x, -x.T]) + 0.5) / ((RESOLUTION / 2) / PICTURE_HALF_WIDTH)
    return torch.cat([metres, torch.ones(1, RESOLUTION, RESOLUTION)]).view(3, -1)


_OUTLINE = _outline()
_TEE_PIXELS = np.flatnonzero(_OUTLINE.T[::-1])  # in the order of the pixel centres
_CENTRES = _pixel_centres()
