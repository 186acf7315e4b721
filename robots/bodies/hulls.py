"""What a robot bumps into things with: the convex hulls of its collision shapes."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from robot_layouts.core.errors import AssetError
from robot_layouts.core.importing import optional
from robot_layouts.core.paths import cached
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.tree import Tree
from robots.bodies.allowed import LinkPair, read_allowed_pairs
from robots.descriptor import RobotDescriptor
from robots.urdf.cleaning.xacro_files import template_of
from robots.urdf.mesh_files import has_volume, read_corners, read_mesh, refers_to_shapes
from robots.urdf.model import UrdfModel, UrdfShape
from robots.urdf.paths import resolve
from robots.urdf.reading import model_of
from robots.urdf.summary import srdf_beside
from robots.urdf.tree import kinematic_tree

SIDES = 32  # of the polygon that stands for a circle; 0.5 % of the radius is lost
_METHOD = b"hull 1"  # to be raised when the same shape comes to another hull


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex body fixed to a link.

    Attributes:
        link: Index of its link in the robot's kinematics; 0 for a body of its own.
        corners: In the link's frame, (n, 3) (m).
        geometry: The same, as FCL has it.
    """

    link: int
    corners: Floats
    geometry: Any


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot's links and hulls, loaded once and shared by every placement of it.

    Attributes:
        kinematics: Its links and joints; positions come in the descriptor's order.
        hulls: Its convex bodies.
        self_pairs: Pairs of hulls of one robot that may not touch; see
            `robots.bodies.allowed.allowed_pairs`.
    """

    kinematics: Tree
    hulls: tuple[Hull, ...]
    self_pairs: tuple[tuple[int, int], ...]

    def link_name(self, hull: int) -> str:
        """Return the name of the link that a hull is fixed to."""
        return self.kinematics.links[self.hulls[hull].link]


def load_model(robot: RobotDescriptor) -> RobotModel:
    """Return a robot's links and hulls; its files are read once, and again if they change.

    Raises:
        AssetError: If its files cannot be found or are invalid.
        DescriptorError: If the descriptor and the URDF contradict each other.
        MissingPackageError: If python-fcl is not installed.
        UnknownNameError: If ``allowed_collisions`` names a link that the URDF lacks.
    """
    require_packages()
    urdf = robot.urdf.locate()
    beside = srdf_beside(urdf)
    return _load(
        robot, urdf, tuple(_modified(file) for file in (template_of(urdf)[0], beside) if file)
    )


def require_packages() -> None:
    """Say which command installs what collision checks need.

    Raises:
        MissingPackageError: If python-fcl is not installed.
    """
    optional("fcl", "checking a layout needs python-fcl", "checks")


def read_hulls(model: UrdfModel, urdf: Path) -> tuple[Hull, ...]:
    """Return the hulls of all collision shapes of a robot, in the order of the URDF's links.

    Args:
        model: What its URDF describes.
        urdf: That URDF, for meshes that it refers to.

    Raises:
        AssetError: If a mesh cannot be read, or a shape has no volume.
        MissingPackageError: If python-fcl is not installed.
    """
    require_packages()
    return _hulls(model, urdf, _modified(template_of(urdf)[0]))


def counted_pairs(
    kinematics: Tree, hulls: Sequence[Hull], allowed: frozenset[LinkPair]
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of hulls of one robot that may not touch, by their indices.

    Args:
        kinematics: Its links.
        hulls: Its hulls.
        allowed: Pairs of links that may overlap.
    """
    links = [kinematics.links[hull.link] for hull in hulls]
    return tuple(
        (a, b)
        for a, b in combinations(range(len(hulls)), 2)
        if links[a] != links[b] and frozenset((links[a], links[b])) not in allowed
    )


def _modified(file: Path) -> int:
    """Return when a file was changed; of a link to nowhere, the link."""
    return os.stat(file, follow_symlinks=os.path.exists(file)).st_mtime_ns


@lru_cache(maxsize=64)
def _load(robot: RobotDescriptor, urdf: Path, _stamps: tuple[int, ...]) -> RobotModel:
    model = model_of(urdf)
    kinematics, hulls = kinematic_tree(model, robot.joints), read_hulls(model, urdf)
    allowed = read_allowed_pairs(robot, model, urdf)
    return RobotModel(kinematics, hulls, counted_pairs(kinematics, hulls, allowed))


@lru_cache(maxsize=64)
def _hulls(model: UrdfModel, urdf: Path, _stamp: int) -> tuple[Hull, ...]:
    tree = kinematic_tree(model)  # every tree of a model has its links in the same order
    return tuple(
        _hull(tree.link(link), *_found(shape, urdf))
        for link in model.links
        for shape in model.collisions.get(link, ())
    )


def _found(shape: UrdfShape, urdf: Path) -> tuple[Floats, Floats]:
    """Return corners (m) and triangles of a shape's hull, from the cache if it was found before."""
    path, contents = urdf.as_posix(), b""

    def find() -> tuple[Floats, Floats]:
        return _corners_and_faces(shape_corners(shape, urdf), shape.where)

    if shape.kind == "mesh":
        path = resolve(shape.file, path, os.path.isfile)
        if refers_to_shapes(path):
            return find()
        contents = read_mesh(path, shape.where)
    asked = json.dumps((shape.kind, shape.sizes, shape.origin.tolist())).encode()
    corners, triangles = cached(path, (_METHOD, asked, contents), find)
    return np.array(corners, float), np.array(triangles, int)


def shape_corners(shape: UrdfShape, urdf: Path) -> Floats:
    """Return the corners of a collision shape in the frame of its link, (n, 3) (m).

    Args:
        shape: The shape.
        urdf: Its URDF, for the mesh that it may refer to.

    Raises:
        AssetError: If that mesh cannot be read.
    """
    return _corners(shape, urdf) @ shape.origin[:3, :3].T + shape.origin[:3, 3]


def _corners(shape: UrdfShape, urdf: Path) -> Floats:
    """Return the corners of a collision shape in its own frame, (n, 3) (m)."""
    if shape.kind == "mesh":
        path = resolve(shape.file, urdf.as_posix(), os.path.isfile)
        return read_corners(path, shape.sizes, shape.where, urdf.as_posix())
    return np.asarray(primitive(shape, SIDES).vertices, float)


def primitive(shape: UrdfShape, sides: int) -> Any:
    """Return a shape that is no mesh as a trimesh, in its own frame (m).

    Args:
        shape: The shape.
        sides: Of the polygon that stands for a circle.
    """
    import trimesh

    match shape.kind:
        case "box":
            return trimesh.creation.box(shape.sizes)
        case "sphere":
            return trimesh.creation.icosphere(subdivisions=3, radius=shape.sizes[0])
        case "cylinder":
            return trimesh.creation.cylinder(*shape.sizes, sections=sides)
        case _:
            radius, length = shape.sizes
            return trimesh.creation.capsule(length, radius, count=[sides, sides])


def convex_hull(link: int, corners: Floats, where: str) -> Hull:
    """Return the convex hull of some points.

    Args:
        link: Index of the link that it is fixed to.
        corners: The points, in the link's frame, (n, 3) (m).
        where: What they belong to, for messages.

    Raises:
        AssetError: If it has no volume.
    """
    return _hull(link, *_corners_and_faces(corners, where))


def _corners_and_faces(corners: Floats, where: str) -> tuple[Floats, Floats]:
    """Return the corners of the convex hull of points, (n, 3), and its triangles, (m, 3)."""
    import trimesh

    if not (np.isfinite(corners).all() and has_volume(corners)):
        raise AssetError(f"{where}: a collision shape without a volume")
    try:
        hull: Any = trimesh.convex.convex_hull(corners)
    except Exception as error:  # qhull's own, for what is all but flat
        raise AssetError(f"{where}: a collision shape without a volume") from error
    return np.asarray(hull.vertices, float), np.asarray(hull.faces, int)


def _hull(link: int, corners: Floats, triangles: Floats) -> Hull:
    import fcl

    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1)
    return Hull(link, corners, fcl.Convex(corners, len(triangles), faces.flatten()))
