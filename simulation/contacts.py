"""Contact forces between pairs, and what counts as a grasp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from robots import Fingers
from simulation.maths import Flags, Floats
from simulation.rotations import rotation_matrix
from simulation.world import World


class LinkTouch(NamedTuple):
    """A link that touched something in the last step of physics.

    Attributes:
        robot: The link's robot, by name.
        link: The link's name.
        other: The component of what it touched.
        sign: 1 if the contact's impulses act on the link, -1 if on the other.
        contact: SAPIEN's contact, good until the next step.
    """

    robot: str
    link: str
    other: Any
    sign: int
    contact: Any


def link_touches(world: World) -> list[LinkTouch]:
    """Return what links touched in a world's last step of physics.

    PhysX refreshes contacts only in a step: after a teleport they are still those of the last one.
    """
    links = world.links
    touches: list[LinkTouch] = []
    for contact in world.system.get_contacts():
        first, second = contact.bodies  # an impulse acts on the first
        if found := links.get(id(first)):
            touches.append(LinkTouch(*found, second, 1, contact))
        if found := links.get(id(second)):
            touches.append(LinkTouch(*found, first, -1, contact))
    return touches


def pairwise_forces(
    world: World, touches: Sequence[LinkTouch], robot: str, links: Sequence[str], body: str
) -> dict[str, NDArray[np.float32]]:
    """Return the contact force of a body on each link that it touches, summed over contacts.

    Args:
        world: The world.
        touches: What `link_touches` returned.
        robot: Robot name.
        links: Names of the links asked about.
        body: Body name.

    Returns:
        Force by link name, shape (3,) (N, world frame); links without contact are left out.
    """
    component = world.body(body).component
    impulses: dict[str, NDArray[np.float64]] = {}
    for touch in touches:
        if touch.other is component and touch.robot == robot and touch.link in links:
            # Native adds them up in float64.
            total = np.sum([point.impulse for point in touch.contact.points], axis=0) * touch.sign
            impulses[touch.link] = impulses.get(touch.link, np.zeros(3)) + total
    timestep = np.array(world.physics.timestep, np.float32)
    return {link: impulse.astype(np.float32) / timestep for link, impulse in impulses.items()}


def grasped(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    """Tell from contact forces whether two fingers hold a body; only if both touch it.

    Args:
        fingers: Which way they open, and the thresholds.
        forces: Force of the body on each finger, shape (N, 2, 3) (N, world frame).
        poses: Pose of each finger link, each (N, 7).

    Returns:
        Shape (N,), bool.
    """
    held = np.logical_and.reduce(np.logical_or.reduce(forces != 0, 2), 1)
    if touched := np.flatnonzero(held).tolist():  # angles cost much, and few worlds need them
        held[touched] = _strong_and_straight(
            fingers, forces[touched], [pose[touched] for pose in poses]
        )
    return held


def _strong_and_straight(fingers: Fingers, forces: Floats, poses: Sequence[Floats]) -> Flags:
    count = len(poses)
    signs = np.repeat(np.array(fingers.opening_signs, np.float32), len(forces))
    turned = rotation_matrix(np.concatenate(poses)[:, 3:])  # one finger's worlds after the other's
    opening = torch.from_numpy(signs[:, None] * turned[:, :, 1])
    force = torch.from_numpy(forces.transpose(1, 0, 2).reshape(-1, 3))
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
