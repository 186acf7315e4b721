"""What a robot bumps into things with: the convex hulls of its collision shapes."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from layouts.validation.kinematics import Floats, Kinematics, origin_matrix
from robots import AssetError, MissingPackageError, RobotDescriptor
from robots.urdf_model import read_model
from robots.urdf_xml import numbers_of, parse_urdf, resolve

SIDES = 32  # of the polygon that stands for a circle; 0.5 % of the radius is lost


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
        self_pairs: Pairs of hulls of one robot that may not touch: their links do not hang on
            each other, and the SRDF beside the URDF does not excuse them.
    """

    kinematics: Kinematics
    hulls: tuple[Hull, ...]
    self_pairs: tuple[tuple[int, int], ...]

    def link_name(self, hull: int) -> str:
        """Return the name of the link that a hull is fixed to."""
        return self.kinematics.links[self.hulls[hull].link]


def load_model(robot: RobotDescriptor) -> RobotModel:
    """Return a robot's links and hulls; its files are read once, and again if they change.

    Raises:
        AssetError: If its files cannot be found or make no sense.
        DescriptorError: If the descriptor and the URDF contradict each other.
        MissingPackageError: If trimesh or python-fcl is not installed.
    """
    require_packages()
    urdf = robot.urdf.locate()
    return _load(urdf, robot.joints, os.stat(urdf).st_mtime_ns)


def require_packages() -> None:
    """Say which command installs what collision checks need.

    Raises:
        MissingPackageError: If trimesh or python-fcl is not installed.
    """
    try:
        for package in ("fcl", "trimesh"):
            import_module(package)
    except ImportError as error:
        raise MissingPackageError(
            "checking a layout needs trimesh and python-fcl: pip install 'robot-layouts[checks]'"
        ) from error


def slab_hull(top: Floats, depth: float, name: str) -> Hull:
    """Return what lies below a flat top, as a body of its own in the world frame.

    Args:
        top: Its corners, (n, 3) (m).
        depth: How far it goes down (m).
        name: Its name, for errors.

    Raises:
        AssetError: If it has no volume.
    """
    return _hull(0, np.concatenate([top, top - [0.0, 0.0, depth]]), name)


@lru_cache(maxsize=64)
def _load(urdf: Path, joints: tuple[str, ...], _modified: int) -> RobotModel:
    xml = urdf.read_bytes()
    kinematics = Kinematics(read_model(xml, str(urdf)), joints)
    hulls = tuple(
        hull
        for element in parse_urdf(xml, str(urdf)).iterfind("link")
        for hull in _link_hulls(element, kinematics.link(element.get("name", "")), urdf)
    )
    excused = _excused_by_srdf(urdf.with_suffix(".srdf"))
    pairs = tuple(
        (a, b)
        for a, b in combinations(range(len(hulls)), 2)
        if _may_touch(kinematics, hulls[a].link, hulls[b].link, excused)
    )
    return RobotModel(kinematics, hulls, pairs)


def _may_touch(kinematics: Kinematics, one: int, other: int, excused: set[frozenset[str]]) -> bool:
    """Tell whether two links can move into each other, and it would matter."""
    first, second = kinematics.bodies[one], kinematics.bodies[other]
    adjacent = kinematics.carrier(first) == second or kinematics.carrier(second) == first
    names = frozenset((kinematics.links[one], kinematics.links[other]))
    return first != second and not adjacent and names not in excused


def _excused_by_srdf(srdf: Path) -> set[frozenset[str]]:
    """Return the pairs of links that an SRDF excuses from collision checks, if there is one."""
    if not srdf.is_file():
        return set()
    root = parse_urdf(srdf.read_bytes(), str(srdf))
    pairs = root.iterfind("disable_collisions")
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs}


def _link_hulls(link: Element, index: int, urdf: Path) -> Iterator[Hull]:
    for collision in link.iterfind("collision"):
        geometry = collision.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        where = f"{urdf}, link {link.get('name')!r}"
        if shape is None:
            raise AssetError(f"{where}: a collision without a shape")
        xyz, rpy = (
            numbers_of(collision.find("origin"), key, (0.0, 0.0, 0.0), where)
            for key in ("xyz", "rpy")
        )
        pose = origin_matrix(xyz, rpy)
        corners = _corners(shape, urdf, where)
        yield _hull(index, corners @ pose[:3, :3].T + pose[:3, 3], where)


def _corners(shape: Element, urdf: Path, where: str) -> Floats:
    """Return the corners of a collision shape in its own frame, (n, 3) (m)."""
    import trimesh

    def size(key: str) -> float:
        return numbers_of(shape, key, (0.0,), where)[0]

    match shape.tag:
        case "mesh":
            scale = numbers_of(shape, "scale", (1.0, 1.0, 1.0), where)
            return _mesh_corners(shape.get("filename", ""), urdf, where) * scale
        case "box":
            made = trimesh.creation.box(numbers_of(shape, "size", (0.0, 0.0, 0.0), where))
        case "sphere":
            made = trimesh.creation.icosphere(subdivisions=3, radius=size("radius"))
        case "cylinder":
            made = trimesh.creation.cylinder(size("radius"), size("length"), sections=SIDES)
        case "capsule":
            made = trimesh.creation.capsule(size("length"), size("radius"), count=[SIDES, SIDES])
        case other:
            raise AssetError(
                f"{where}: a collision of shape {other!r}; choices: mesh, box, sphere, cylinder,"
                " capsule"
            )
    return np.asarray(made.vertices, float)


def _mesh_corners(reference: str, urdf: Path, where: str) -> Floats:
    import trimesh

    path = resolve(reference, posixpath.dirname(urdf.as_posix()), os.path.isfile)
    if not os.path.isfile(path):
        raise AssetError(f"{where} refers to a file that does not exist: {path}")
    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # a reader of many formats, which raises whatever it meets
        raise AssetError(f"{where}: cannot read the mesh {path}: {error}") from error
    return np.asarray(mesh.vertices, float)


def _hull(link: int, corners: Floats, where: str) -> Hull:
    import fcl
    import trimesh

    solid = len(corners) > 3 and np.isfinite(corners).all()
    if not solid or np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=1e-6) < 3:
        raise AssetError(f"{where}: a collision shape without a volume")
    hull: Any = trimesh.convex.convex_hull(corners)
    vertices, triangles = np.asarray(hull.vertices, float), np.asarray(hull.faces, int)
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1)
    return Hull(link, vertices, fcl.Convex(vertices, len(triangles), faces.flatten()))
