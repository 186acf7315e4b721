"""What counts as a grasp, by the contact forces on two fingers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from robot_layouts.simulation.maths import Flags, Floats
from robot_layouts.simulation.rotations import rotation_matrix
from robots import Fingers


def grasped(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    """Tell from contact forces whether two fingers hold a body; only if both touch it.

    Args:
        fingers: Which way they open, and the thresholds.
        forces: Force of the body on each finger, shape (2, N, 3) (N, world frame).
        poses: Pose of each finger link, each (N, 7).

    Returns:
        Shape (N,), bool.
    """
    held = np.logical_and.reduce(np.logical_or.reduce(forces != 0, 2), 0)
    if touched := np.flatnonzero(held).tolist():  # angles cost much, and few worlds need them
        held[touched] = _strong_and_straight(
            fingers, forces[:, touched], [pose[touched] for pose in poses]
        )
    return held


def _strong_and_straight(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    count = len(poses)
    signed = np.array(fingers.opening_axes) * np.array(fingers.opening_signs)[:, None]
    axes = np.repeat(signed.astype(np.float32), forces.shape[1], axis=0)
    turned = rotation_matrix(np.concatenate(poses)[:, 3:])  # one finger's worlds after the other's
    opening = torch.from_numpy((turned * axes[:, None]).sum(axis=2))
    force = torch.from_numpy(forces.reshape(-1, 3))
    strong = torch.linalg.vector_norm(force, dim=1) >= fingers.min_force
    angle = torch.rad2deg(_angle_between(opening, force))
    held = strong & (angle <= fingers.max_angle)
    return held.reshape(count, -1).all(dim=0).numpy()


def _angle_between(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Angle between vectors (N, 3), shape (N,) (rad)."""
    cosine = torch.einsum("ij,ij->i", _unit(a), _unit(b))
    return torch.arccos(torch.clip(cosine, -1, 1))


def _unit(vector: torch.Tensor) -> torch.Tensor:
    """Vectors (N, 3) scaled to length 1; shorter ones than 1e-6 stay as they are."""
    norm = torch.linalg.vector_norm(vector, dim=1)
    norm = 1 / torch.where(norm < 1e-6, 1.0, norm)
    return torch.multiply(vector, norm[:, None])
