"""What is read of a robot's URDF once, for any number of worlds: SAPIEN's builder, and its check.

SAPIEN leaves out what it cannot read and says so only in its log. So it is given only what a URDF's
model has let through, and what it built is compared with that model.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import sapien
import sapien.physx as physx
from sapien.wrapper.articulation_builder import MimicJointRecord

from robot_layouts.simulation.sapien3.builder import make_builder
from robot_layouts.simulation.sapien3.light_meshes import FINISH
from robot_layouts.simulation.world import Visuals
from robots import AssetError, RobotDescriptor, UnknownNameError
from robots.bodies.allowed import LinkPair, joined_pairs, read_allowed_pairs
from robots.bodies.overlaps import without_distant
from robots.urdf.mesh_files import has_body, load_scene
from robots.urdf.model import ModelJoint, UrdfModel, UrdfShape
from robots.urdf.paths import resolve
from robots.urdf.reading import read_model
from robots.urdf.srdf import ExcludedPair, read_excluded_pairs
from robots.urdf.summary import parse_urdf, read_urdf

# Which shapes SAPIEN lets collide: those of which word 0 of one has a bit of word 1 of the other,
# unless their words 2 have a bit in common and the lower halves of their words 3 are equal. So all
# links of a set in which any two may overlap get the same bit of word 2, and every robot of a world
# a word 3 of its own. Floors, and links that they let through, collide with all but each other.
BITS = 32  # of word 2

# Words 0 and 1.
USUAL = (1, 1)
FLOOR = (1, 0)
NO_FLOOR_CONTACT = (3, 2)
MOST_PAIRS = 31  # that SAPIEN's URDF loader, and so native, keeps apart: a bit each


def overlap_words(descriptor: RobotDescriptor, model: UrdfModel, urdf: Path) -> dict[str, int]:
    """Return word 2 of the links that may overlap others which PhysX does not let by itself.

    Args:
        descriptor: The robot, which says what its ``allowed_collisions`` are.
        model: What its URDF describes.
        urdf: That URDF.

    Raises:
        AssetError: If `BITS` bits are too few, or a mesh that is then looked at cannot be read.
        UnknownNameError: If ``allowed_collisions`` names a link that the URDF lacks.
    """
    solid = model.collisions.keys()
    allowed = {pair for pair in read_allowed_pairs(descriptor, model, urdf) if pair <= solid}
    joined = {pair for pair in joined_pairs(model) if pair <= solid}
    cliques = cover(allowed - joined, joined)
    if len(cliques) > BITS:
        cliques = cover(set(without_distant(allowed - joined, model, urdf)), allowed)
    if len(cliques) > BITS:
        raise AssetError(
            f"{descriptor.name}: SAPIEN keeps {BITS} groups of links that may all overlap each"
            f" other, and its allowed collisions take {len(cliques)}; allow fewer pairs, or all"
            " those of whole parts of the robot"
        )
    return common_bits(cliques)


def common_bits(sets: Iterable[set[str]]) -> dict[str, int]:
    """Return word 2 of the links of sets, in each of which any two may overlap: a bit for each."""
    words = dict[str, int]()
    for bit, links in enumerate(sets):
        for link in links:
            words[link] = words.get(link, 0) | 1 << bit
    return words


def cover(pairs: set[LinkPair], given: set[LinkPair]) -> list[set[str]]:
    """Return sets of links that hold all of some pairs, and no pair but these and some given.

    Each set is grown greedily, by the link that brings most pairs that no set holds yet.

    Args:
        pairs: Pairs that a set has to hold.
        given: Pairs that a set may hold.
    """
    partners: dict[str, set[str]] = {}
    for one, other in map(sorted, pairs | given):
        partners.setdefault(one, set()).add(other)
        partners.setdefault(other, set()).add(one)
    waiting, cliques = set(pairs), list[set[str]]()
    while waiting:
        clique = set(min(waiting, key=lambda pair: (_shared(pair, partners), sorted(pair))))
        while joining := set.intersection(*(partners[link] for link in clique)):
            gains = {link: _gain(link, clique, waiting) for link in sorted(joining)}
            best = max(gains, key=gains.__getitem__)
            if gains[best] == 0:
                break
            clique.add(best)
        waiting = {pair for pair in waiting if not pair <= clique}
        cliques.append(clique)
    return cliques


def _shared(pair: LinkPair, partners: dict[str, set[str]]) -> int:
    """Return how many links could join a pair; few leave little choice, so they come first."""
    return len(set.intersection(*(partners[link] for link in pair)))


def _gain(link: str, clique: set[str], waiting: set[LinkPair]) -> int:
    return sum(frozenset((link, other)) in waiting for other in clique)


@dataclass
class Blueprint:
    """A robot as its files describe it; it builds as often as it is asked to.

    Attributes:
        urdf: Its URDF.
        model: What that describes.
        contents: Its XML.
        builder: SAPIEN's builder of an articulation.
        overlaps: Word 2 of the collision groups of links that may overlap others.
        from_srdf: Whether an SRDF says which may, and not the descriptor.
        no_floor_contact: Links that floors let through.
        checked: Whether an articulation that it built was compared with the model.
    """

    urdf: Path
    model: UrdfModel
    contents: bytes
    builder: Any
    overlaps: dict[str, int]
    from_srdf: bool
    no_floor_contact: tuple[str, ...]
    checked: bool = False

    def build(
        self, scene: sapien.Scene, pose: sapien.Pose, number: int = 0, *, links_pass: bool = False
    ) -> Any:
        """Build an articulation in a scene and return it.

        Args:
            scene: SAPIEN's scene.
            pose: Of its base.
            number: Which of the scene's robots it is.
            links_pass: Whether its links pass through those of other robots where SAPIEN's URDF
                loader lets them: it gives the pairs of each robot's SRDF the same bits.

        Raises:
            AssetError: If SAPIEN left out a collision shape.
        """
        self.builder.set_scene(scene)
        self.builder.set_initial_pose(pose)
        for link in self.builder.link_builders:
            for record in link.visual_records:
                record.material = _copied(record.material)
        own = 0 if self.from_srdf and links_pass else number + 1
        for link in self.builder.link_builders:
            words = NO_FLOOR_CONTACT if link.name in self.no_floor_contact else USUAL
            link.collision_groups = [*words, self.overlaps.get(link.name, 0), own]
        articulation = self.builder.build()
        self.builder.set_scene(None)  # else it would keep the scene alive
        articulation.set_root_pose(pose)
        if not self.checked:
            _expect_all_shapes(articulation, self.model, self.urdf)
            self.checked = True
        return articulation


def read_blueprint(descriptor: RobotDescriptor, *, visuals: Visuals) -> Blueprint:
    """Read a robot's files, once for any number of worlds with the same physics settings.

    Args:
        descriptor: The robot.
        visuals: Whether to read what pictures need, and which meshes to draw.

    Raises:
        AssetError: If its files cannot be found, or are invalid.
        MissingPackageError: If a mesh cannot be read, or made lighter, because a package is
            missing.
        UnknownNameError: If ``allowed_collisions`` or ``no_floor_contact`` names a link that the
            URDF lacks.
    """
    urdf = descriptor.urdf.locate(pictures=bool(visuals))
    contents = read_urdf(urdf)
    model = read_model(contents, urdf.as_posix())
    for link in descriptor.no_floor_contact:
        if link not in model.links:
            raise UnknownNameError(
                f"link in no_floor_contact of {descriptor.name}", link, model.links
            )
    _expect_meshes(model, urdf, visuals=bool(visuals))
    from_srdf = descriptor.allowed_collisions is None
    if from_srdf:
        overlaps = common_bits(_pairs(read_excluded_pairs(urdf), model, urdf))
    else:
        overlaps = overlap_words(descriptor, model, urdf)
    root, material = parse_urdf(contents, urdf.as_posix()), descriptor.gripper_material
    builder = make_builder(model, root, urdf.as_posix(), material, visuals=visuals)
    builder.mimic_joint_records = [
        MimicJointRecord(joint.name, joint.mimics, joint.multiplier, joint.offset)
        for joint in model.ordered
        if joint.mimics is not None and _needs_tendon(joint, descriptor, model)
    ]
    loose = descriptor.no_floor_contact
    return Blueprint(urdf, model, contents, builder, overlaps, from_srdf, loose)


def _copied(material: Any) -> Any:
    """Return a material for one articulation alone, which can be painted by itself."""
    if material is None:
        return None
    own = type(material)()
    for name in ("base_color_texture", *FINISH):
        setattr(own, name, getattr(material, name))
    return own


def _needs_tendon(joint: ModelJoint, descriptor: RobotDescriptor, model: UrdfModel) -> bool:
    """Tell whether SAPIEN should tie a joint to the one that it mimics.

    Its ties are far stiffer than most drives, pull along a chain, and then end in NaN or a crash.
    So a joint that has a drive of its own gets none, but for one beside its leader that moves just
    as it does: ManiSkill ties such fingers, and what clones it is equal to its last bit.
    """
    leader = next(other for other in model.joints if other.name == joint.mimics)
    alike = joint.multiplier == 1 and joint.offset == 0
    return joint.name not in descriptor.joints or (alike and joint.parent == leader.parent)


def _pairs(excluded: Iterable[ExcludedPair], model: UrdfModel, urdf: Path) -> list[set[str]]:
    """Return the pairs of an SRDF that native's physics leaves out, which it takes by their reason.

    PhysX by itself leaves out those that a joint joins.
    """
    known = set(model.links)
    joined = [{joint.parent, joint.child} for joint in model.joints]
    named = (set(pair.links) for pair in excluded if pair.reason.lower() == "default")
    pairs = [pair for pair in named if len(known & pair) == 2 and pair not in joined]
    if len(pairs) > MOST_PAIRS:
        raise AssetError(
            f"the SRDF beside {urdf} leaves {len(pairs)} pairs of links out of collisions; SAPIEN"
            f" can do so with {MOST_PAIRS} at most (a descriptor that names them itself, as"
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
