"""What counts as a grasp, by the contact forces on two fingers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import cos, hypot, radians, sqrt
from typing import NamedTuple

import numpy as np
import torch

from robot_layouts.simulation.maths import Flags, Floats
from robot_layouts.simulation.rotations import rotation_matrix
from robots import Fingers
from robots.descriptor import Vector3

# So near to a threshold native's float32 decides: it is at most a tenth of this away from what
# a plain float gives. Of the force (N, and as a share of it) and of the angle's cosine.
NEAR_FORCE, NEAR_COSINE = 1e-4, 1e-5
LARGEST = 1e9  # N, and of a quaternion's entries: float32 holds the square of neither much longer
FEW = 32  # worlds up to which plain floats take less time than torch: half of it for so many


class Thresholds(NamedTuple):
    """What a finger's force is compared with.

    Attributes:
        opening: Direction in which it opens, in the frame of its link; of length 1.
        force: Smallest force (N).
        cosine: Of the largest angle.
    """

    opening: Vector3
    force: float
    cosine: float


def grasped(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    """Tell from contact forces whether two fingers hold a body; only if both touch it.

    Args:
        fingers: Which way they open, and the thresholds.
        forces: Force of the body on each finger, shape (2, N, 3) (N, world frame).
        poses: Pose of each finger link, each (N, 7).

    Returns:
        Shape (N,), bool.
    """
    rows = forces.tolist()
    touched = [env for env, both in enumerate(zip(*rows, strict=True)) if all(map(any, both))]
    held = np.zeros(forces.shape[1], bool)
    unclear = touched  # angles cost much, and few worlds need them
    if len(touched) <= FEW:
        unclear = []
        for env in touched:
            pressing = [own[env] for own in rows]
            clear = _clearly_held(fingers, pressing, [pose[env].tolist() for pose in poses])
            if clear is None:
                unclear.append(env)
            else:
                held[env] = clear
    if unclear:
        held[unclear] = _strong_and_straight(
            fingers, forces[:, unclear], [pose[unclear] for pose in poses]
        )
    return held


def _clearly_held(
    fingers: Fingers, forces: Sequence[Sequence[float]], poses: Sequence[Sequence[float]]
) -> bool | None:
    """Tell whether two fingers hold a body in one world; None if that is near a threshold.

    Args:
        fingers: Which way they open, and the thresholds.
        forces: Force on each finger, each (3,) (N, world frame).
        poses: Pose of each finger link, each (7,).
    """
    clear: bool | None = True
    for limits, force, pose in zip(thresholds(fingers), forces, poses, strict=True):
        one = _clearly_presses(limits, force, pose)
        if one is False:
            return False
        clear = clear and one
    return clear


def _clearly_presses(
    limits: Thresholds, force: Sequence[float], pose: Sequence[float]
) -> bool | None:
    """Tell whether one finger's force, (3,) (N), is strong and straight; None if that is near."""
    (a, b, c), (fx, fy, fz), (_, _, _, w, x, y, z) = limits.opening, force, pose
    strength = sqrt(fx * fx + fy * fy + fz * fz)
    squared = w * w + x * x + y * y + z * z
    near = NEAR_FORCE * (1 + limits.force)
    if not (strength < LARGEST and 1 / LARGEST < squared < LARGEST):
        return None
    if strength < limits.force - near:
        return False
    if strength < limits.force + near:
        return None
    scale = 2 / squared
    p, q, r = scale * (y * c - z * b), scale * (z * a - x * c), scale * (x * b - y * a)
    along = (
        fx * (a + w * p + y * r - z * q)
        + fy * (b + w * q + z * p - x * r)
        + fz * (c + w * r + x * q - y * p)
    )
    beyond = along - limits.cosine * strength
    return None if abs(beyond) <= NEAR_COSINE * strength else beyond > 0


@lru_cache(maxsize=256)
def thresholds(fingers: Fingers) -> list[Thresholds]:
    """Return what the force on each of two fingers is compared with."""
    cosine = cos(radians(fingers.max_angle))
    return [
        Thresholds((x / length, y / length, z / length), fingers.min_force, cosine)
        for (x, y, z), sign in zip(fingers.opening_axes, fingers.opening_signs, strict=True)
        for length in [sign * hypot(x, y, z)]
    ]


def _strong_and_straight(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    """Tell whether two fingers hold bodies, as native computes it; see `grasped`."""
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
