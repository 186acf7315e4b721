"""What the links of a URDF weigh, and what hangs on each joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinematics.rotations import Floats
from kinematics.tree import Tree
from robots.urdf.model import UrdfModel

WATER = 1000.0  # kg/m³


@dataclass(frozen=True, eq=False)
class Masses:
    """Masses of the links of a tree, in its order.

    Attributes:
        mass: (links,) (kg); 0 of a link without numbers and without shapes.
        centre: Centres of mass in the links' frames, (links, 3) (m).
        inertia: About those, turned as the links, (links, 3, 3) (kg·m²).
    """

    mass: Floats
    centre: Floats
    inertia: Floats


def read_masses(model: UrdfModel, tree: Tree, bodies: Mapping[int, Sequence[Floats]]) -> Masses:
    """Return what the links of a URDF weigh; without numbers, as much as their shapes in water.

    Args:
        model: What the URDF describes.
        tree: Its links.
        bodies: Corners of the convex bodies of links, by index, in their frames (m).
    """
    rows: list[tuple[float, Floats, Floats]] = []
    for i, link in enumerate(tree.links):
        inertial = model.inertials.get(link)
        if inertial is None or not inertial.mass:
            rows.append(_of_shapes(bodies.get(i, ())))
        else:
            turn = inertial.origin[:3, :3]
            rows.append((inertial.mass, inertial.origin[:3, 3], turn @ inertial.tensor @ turn.T))
    mass, centre, inertia = (np.array(column) for column in zip(*rows, strict=True))
    return Masses(mass, centre, inertia)


def _of_shapes(bodies: Sequence[Floats]) -> tuple[float, Floats, Floats]:
    """Return mass, centre and inertia of bodies with the density of water, as SAPIEN takes it."""
    if not bodies:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    import trimesh

    hulls: list[Any] = [trimesh.convex.convex_hull(corners) for corners in bodies]
    mass = np.array([hull.volume * WATER for hull in hulls])
    centres = np.array([hull.center_mass for hull in hulls])
    centre = mass @ centres / mass.sum()
    inertia = np.zeros((3, 3))
    for hull, weight, off in zip(hulls, mass, centres - centre, strict=True):
        inertia += hull.moment_inertia * WATER
        inertia += weight * (off @ off * np.eye(3) - np.outer(off, off))
    return float(mass.sum()), centre, inertia


def hanging_inertia(tree: Tree, masses: Masses, poses: Floats, links: Iterable[int]) -> Floats:
    """Return the inertia that each joint moves, with the others held, (links given,).

    Of a joint that turns about its axis (kg·m²), of one that slides the mass (kg); the largest of
    some postures.

    Args:
        tree: The links.
        masses: What they weigh.
        poses: Of the links in each posture, (postures, links, 4, 4) (m).
        links: Indices of the links that the joints carry.
    """
    behind = _behind(tree)
    return np.array([_about(tree, masses, poses, link, behind[link]) for link in links])


def _behind(tree: Tree) -> list[list[int]]:
    behind = [[i] for i in range(len(tree.links))]
    for i in range(len(tree.links) - 1, 0, -1):
        behind[tree.parents[i]] += behind[i]
    return behind


def _about(tree: Tree, masses: Masses, poses: Floats, link: int, behind: list[int]) -> float:
    mass = masses.mass[behind]
    if tree.slides[link]:
        return float(mass.sum())
    turned = poses[:, behind, :3, :3]
    centre = (turned @ masses.centre[behind][..., None])[..., 0] + poses[:, behind][..., :3, 3]
    axis = poses[:, link, :3, :3] @ tree.axes[link]
    arm = centre - poses[:, link, None, :3, 3]
    off = arm - (arm @ axis[..., None]) * axis[:, None]
    local = (np.swapaxes(turned, -1, -2) @ axis[:, None, :, None])[..., 0]
    own = np.einsum("pli,lij,plj->pl", local, masses.inertia[behind], local)
    return float((own + mass * (off**2).sum(axis=-1)).sum(axis=-1).max())
