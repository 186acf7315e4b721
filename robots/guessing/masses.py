"""What the links of a URDF weigh, and what hangs on each joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from kinematics.rotations import Floats, rpy_pose
from kinematics.tree import Tree
from robots.urdf.numbers import numbers_of

WATER = 1000.0  # kg/m³
_PRODUCTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


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


def read_masses(root: Element, tree: Tree, bodies: Mapping[int, Sequence[Floats]]) -> Masses:
    """Return what the links of a URDF weigh; without numbers, as much as their shapes in water.

    Args:
        root: Its ``<robot>``, whose numbers make sense; see `robots.urdf.inertia`.
        tree: Its links.
        bodies: Corners of the convex bodies of links, by index, in their frames (m).
    """
    inertial = {link.get("name"): link.find("inertial") for link in root.iterfind("link")}
    rows = [_row(inertial.get(link)) for link in tree.links]
    rows = [row if row[0] else _of_shapes(bodies.get(i, ())) for i, row in enumerate(rows)]
    mass, centre, inertia = (np.array(column) for column in zip(*rows, strict=True))
    return Masses(mass, centre, inertia)


def _row(inertial: Element | None) -> tuple[float, Floats, Floats]:
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    origin = inertial.find("origin")
    xyz, rpy = (numbers_of(origin, key, (0.0, 0.0, 0.0), "") for key in ("xyz", "rpy"))
    pose = rpy_pose(xyz, rpy)
    mass = numbers_of(inertial.find("mass"), "value", (0.0,), "")[0]
    tensor = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (numbers_of(tensor, key, (0.0,), "")[0] for key in _PRODUCTS)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass, pose[:3, 3], pose[:3, :3] @ inertia @ pose[:3, :3].T


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
