"""What is read of a robot's URDF once, for any number of worlds: SAPIEN's builder, and its check.

SAPIEN leaves out what it cannot read and says so only in its log. So it is given only what a URDF's
model has let through, and what it built is compared with that model.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import sapien
import sapien.physx as physx
from sapien.wrapper.urdf_loader import URDFLoader

from robot_layouts.simulation.sapien3.collision_groups import NO_FLOOR_CONTACT, USUAL, overlap_words
from robots import AssetError, RobotDescriptor, UnknownNameError
from robots.urdf.mesh_files import has_body, load_scene, read_corners
from robots.urdf.model import UrdfModel, UrdfShape
from robots.urdf.paths import resolve
from robots.urdf.reading import read_model
from robots.urdf.srdf import ExcludedPair, read_excluded_pairs
from robots.urdf.summary import parse_urdf, read_urdf

MOST_PAIRS = 31  # that SAPIEN's loader can keep apart: a bit each

# What physics and pictures need of a URDF; SAPIEN stumbles over some of the rest.
ELEMENTS = ("link", "joint", "material")
JOINT_PARTS = ("parent", "child", "origin", "axis")
MOVING_PARTS = (*JOINT_PARTS, "limit", "dynamics", "mimic")
DEFAULTS = {"limit": ("lower", "upper"), "dynamics": ("damping", "friction")}  # 0, if left out


@dataclass
class Blueprint:
    """A robot as its files describe it; it builds as often as it is asked to.

    Attributes:
        urdf: Its URDF.
        model: What that describes.
        text: Its XML, as far as SAPIEN takes it.
        builder: SAPIEN's builder of an articulation.
        overlaps: Word 2 of the collision groups of links that may overlap others; None where
            SAPIEN's loader has set them.
        no_floor_contact: Links that floors let through.
        checked: Whether an articulation that it built was compared with the model.
    """

    urdf: Path
    model: UrdfModel
    text: str
    builder: Any
    overlaps: dict[str, int] | None = None
    no_floor_contact: tuple[str, ...] = ()
    checked: bool = False

    def build(
        self, scene: sapien.Scene, pose: sapien.Pose, number: int = 0, *, links_pass: bool = False
    ) -> Any:
        """Build an articulation in a scene and return it.

        Args:
            scene: SAPIEN's scene.
            pose: Of its base.
            number: Which of the scene's robots it is.
            links_pass: Whether its links pass through those of other robots where SAPIEN's loader
                lets them: it numbers the pairs that may overlap in each robot from 1.

        Raises:
            AssetError: If SAPIEN left out a collision shape.
        """
        self.builder.set_scene(scene)
        self.builder.set_initial_pose(pose)
        for link in self.builder.link_builders:
            for record in link.visual_records:
                record.material = _copied(record.material)
        own = number + 1 if self.overlaps is not None or not links_pass else 0
        for link in self.builder.link_builders:
            words = NO_FLOOR_CONTACT if link.name in self.no_floor_contact else USUAL
            overlaps = link.collision_groups[2]
            if self.overlaps is not None:
                overlaps = self.overlaps.get(link.name, 0)
            link.collision_groups = [*words, overlaps, own]
        articulation = self.builder.build()
        self.builder.set_scene(None)  # else it would keep the scene alive
        articulation.set_root_pose(pose)
        if not self.checked:
            _expect_all_shapes(articulation, self.model, self.urdf)
            self.checked = True
        return articulation


def read_blueprint(descriptor: RobotDescriptor, *, visuals: bool) -> Blueprint:
    """Read a robot's files, once for any number of worlds with the same physics settings.

    Args:
        descriptor: The robot.
        visuals: Whether to read what pictures need.

    Raises:
        AssetError: If its files cannot be found, or are invalid.
        MissingPackageError: If a mesh cannot be read because a package is missing.
        UnknownNameError: If ``allowed_collisions`` or ``no_floor_contact`` names a link that the
            URDF lacks.
    """
    urdf = descriptor.urdf.locate(pictures=visuals)
    contents = read_urdf(urdf)
    model = read_model(contents, urdf.as_posix())
    for link in descriptor.no_floor_contact:
        if link not in model.links:
            raise UnknownNameError(
                f"link in no_floor_contact of {descriptor.name}", link, model.links
            )
    _expect_meshes(model, urdf, visuals=visuals)
    loader: Any = _TextLoader()
    loader.set_scene(sapien.Scene([]))  # which hands out empty builders and is not built in
    loader.fix_root_link = True
    if material := descriptor.gripper_material:
        friction = material.static_friction, material.dynamic_friction, material.restitution
        for link in material.links:
            loader.set_link_material(link, *friction)
            loader.set_link_patch_radius(link, material.patch_radius)
            loader.set_link_min_patch_radius(link, material.patch_radius)
    text = _for_sapien(contents, urdf.as_posix(), visuals=visuals)
    own = descriptor.allowed_collisions is not None
    overlaps = overlap_words(descriptor, model, urdf) if own else None
    pairs = [] if own else _pairs(read_excluded_pairs(urdf), model, urdf)
    try:
        builder = loader.load_text(text, urdf, pairs)
    except Exception as error:  # SAPIEN's parser raises whatever it meets
        raise AssetError(
            f"SAPIEN cannot read {urdf}: {str(error) or type(error).__name__}"
        ) from error
    tendons = builder.mimic_joint_records
    builder.mimic_joint_records = [t for t in tendons if _needs_tendon(t, descriptor, model)]
    return Blueprint(urdf, model, text, builder, overlaps, descriptor.no_floor_contact)


class _TextLoader(URDFLoader):
    """A URDF loader that takes text, and finds every mesh that a locator found.

    SAPIEN's own drops meshes of a ``package://`` whose folder has another name, saying so only in
    its log.
    """

    def load_text(self, text: str, urdf: Path, pairs: list[set[str]]) -> Any:
        """Return a builder for the one articulation of a URDF.

        Args:
            text: The URDF's XML.
            urdf: Its path, for what it refers to.
            pairs: Links that may overlap.
        """
        self.package_dir = None
        self.urdf, self.urdf_dir = urdf.as_posix(), str(urdf.parent)
        self.ignore_pairs = pairs
        builders, actors, _ = self._parse_urdf(text)
        if len(builders) != 1 or actors:
            raise AssetError(f"{urdf} describes no single robot with joints")
        return builders[0]

    def _build_link(self, link: Any, link_builder: Any) -> None:
        for part in (*link.collisions, *link.visuals):
            mesh = part.geometry.mesh
            if mesh is not None:
                mesh.filename = resolve(mesh.filename, self.urdf, os.path.isfile)
        for part in link.collisions:
            mesh = part.geometry.mesh
            if mesh is not None and mesh.scale is not None and min(mesh.scale) < 0:
                where = f"{self.urdf}, link {link.name!r}"
                scale = tuple(mesh.scale.tolist())
                mesh.filename = unmirrored(mesh.filename, scale, where, self.urdf)
                mesh.scale = None
        super()._build_link(link, link_builder)


def _copied(material: Any) -> Any:
    """Return a URDF's material for one articulation alone, which can be painted by itself."""
    if material is None:
        return None
    own = type(material)(base_color=material.base_color)
    own.base_color_texture = material.base_color_texture
    return own


def _needs_tendon(mimic: Any, descriptor: RobotDescriptor, model: UrdfModel) -> bool:
    """Tell whether SAPIEN should tie a joint to the one that it mimics.

    Its ties are far stiffer than most drives, pull along a chain, and then end in NaN or a crash.
    So a joint that has a drive of its own gets none, but for one beside its leader that moves just
    as it does: ManiSkill ties such fingers, and what clones it is equal to its last bit.
    """
    parents = {joint.name: joint.parent for joint in model.joints}
    alike = mimic.multiplier == 1 and mimic.offset == 0
    beside = parents[mimic.joint] == parents[mimic.mimic]
    return mimic.joint not in descriptor.joints or (alike and beside)


@lru_cache(maxsize=64)
def _for_sapien(xml: bytes, urdf: str, *, visuals: bool) -> str:
    """Return a URDF's XML without what neither physics nor pictures use, and with defaults."""
    root = parse_urdf(xml, urdf)
    for element in list(root):
        if element.tag not in ELEMENTS or (element.tag == "material" and not visuals):
            root.remove(element)
    for joint in root.iterfind("joint"):
        used = JOINT_PARTS if joint.get("type") == "fixed" else MOVING_PARTS
        for part in list(joint):
            if part.tag not in used:
                joint.remove(part)
            for key in DEFAULTS.get(part.tag, ()):
                part.set(key, part.get(key, "0"))
    for link in root.iterfind("link") if not visuals else ():
        for visual in link.findall("visual"):
            link.remove(visual)
    return ElementTree.tostring(root, encoding="unicode")


def _pairs(excluded: Iterable[ExcludedPair], model: UrdfModel, urdf: Path) -> list[set[str]]:
    """Return the pairs of an SRDF that physics leaves out, which SAPIEN takes by their reason."""
    known = set(model.links)
    pairs = [
        set(pair.links)
        for pair in excluded
        if pair.reason.lower() == "default" and len(known & set(pair.links)) == 2
    ]
    joined = [{joint.parent, joint.child} for joint in model.joints]
    apart = sum(pair not in joined for pair in pairs)
    if apart > MOST_PAIRS:
        raise AssetError(
            f"the SRDF beside {urdf} leaves {apart} pairs of links out of collisions; SAPIEN can do"
            f" so with {MOST_PAIRS} at most (a descriptor that names them itself, as"
            " allowed_collisions, may have more)"
        )
    return pairs


def _expect_meshes(model: UrdfModel, urdf: Path, *, visuals: bool) -> None:
    """Refuse meshes that the checks of a layout and its pictures would refuse."""
    for shape in _meshes(model.collisions.values()):
        has_body(_path(shape, urdf), shape.sizes, shape.where, urdf.as_posix())
    for shape in _meshes(model.visuals.values()) if visuals else ():
        _expect_scene(*_identity(shape, urdf), shape.where, urdf.as_posix())


def _identity(mesh: UrdfShape, urdf: Path) -> tuple[str, tuple[int, ...]]:
    """Return a mesh file's path and what changes with its contents; nothing if it is missing."""
    path = _path(mesh, urdf)
    try:
        status = os.stat(path)
    except OSError:
        return path, ()
    return path, (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


# Reading takes trimesh milliseconds a file, and leaves garbage; a file is read once by a process.
@lru_cache(maxsize=4096)
def _expect_scene(path: str, identity: tuple[int, ...], where: str, urdf: str) -> None:
    load_scene(path, where, urdf)


def _path(mesh: UrdfShape, urdf: Path) -> str:
    return resolve(mesh.file, urdf.as_posix(), os.path.isfile)


def _meshes(links: Iterable[tuple[UrdfShape, ...]]) -> Iterable[UrdfShape]:
    return (shape for shapes in links for shape in shapes if shape.kind == "mesh")


def _expect_all_shapes(articulation: Any, model: UrdfModel, urdf: Path) -> None:
    """Refuse an articulation that lacks a shape of its URDF; SAPIEN makes one of each."""
    for link in articulation.links:
        shapes = model.collisions.get(link.name, ())
        made = len(link.collision_shapes)
        if made != len(shapes):
            files = [f"{shape.file!r}" for shape in shapes if _cannot_cook(shape, urdf)]
            raise AssetError(
                f"{urdf}, link {link.name!r}: SAPIEN made {made} of its {len(shapes)} collision"
                f" shapes; it cannot make a convex body of {', '.join(files) or 'the others'}"
            )


def _cannot_cook(shape: UrdfShape, urdf: Path) -> bool:
    if shape.kind != "mesh":
        return False
    scale, material = list(shape.sizes), physx.get_default_material()
    try:
        physx.PhysxCollisionShapeConvexMesh(_path(shape, urdf), scale, material)
    except RuntimeError:
        return True
    return False


def unmirrored(path: str, scale: tuple[float, ...], where: str, urdf: str) -> str:
    """Return a mesh file that needs no scale, whose convex hull is that of another one scaled.

    PhysX knows no convex bodies of negative scale: it builds them, and the process crashes where
    two of them touch.

    Args:
        path: A mesh file.
        scale: Its factors along x, y and z, some of them negative.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to.

    Raises:
        AssetError: If it cannot be read.
    """
    return _written(path, Path(path).stat().st_mtime_ns, scale, where, urdf)


@lru_cache(maxsize=1024)
def _written(path: str, _modified: int, scale: tuple[float, ...], where: str, urdf: str) -> str:
    import trimesh

    hull: Any = trimesh.convex.convex_hull(read_corners(path, scale, where, urdf))
    folder = Path(_folder().name)
    target = folder / f"{len(list(folder.iterdir()))}_{Path(path).stem}.stl"
    hull.export(target)
    return str(target)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed when this process ends."""
    return tempfile.TemporaryDirectory(prefix="robot-layouts-")
