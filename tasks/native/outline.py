"""The outline of a triangle as points, in float64, with native's order of operations."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.simulation.maths import Array, Floats, by_torch

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
