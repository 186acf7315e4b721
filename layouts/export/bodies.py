"""A task's bodies as every format asks for them: links, shapes, masses and joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from layouts.export.cell import JointDrive
from layouts.export.meshes import AS_HULLS, CollisionShape, Drawn, hull_of
from layouts.visuals import Rgba, Visual, load_meshes, mean_color, shown_color, simplified
from objects import ObjectDescriptor
from objects.joints import Joint
from objects.shapes import (
    Box,
    Capsule,
    Cylinder,
    Floor,
    Mesh,
    Plane,
    Shape,
    Sphere,
)
from objects.solids import inertia_of, mass_of, pieces, surface
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robots.descriptor import Vector3
from robots.urdf.mesh_files import read_corners
from robots.urdf.model import LinkInertia, ModelJoint, UrdfShape

EARTH: Vector3 = (0.0, 0.0, -9.81)  # m/s²
PLANE = "plane"  # a kind of shape that no URDF has: infinite, its normal along x
_ALONG_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # wxyz; cylinders lie along x here, along z elsewhere
_KINDS = {"slide": "prismatic", "turn": "revolute"}


@dataclass(frozen=True, eq=False)
class BodyShape:
    """What collides of a body.

    Attributes:
        solid: The shape.
        of: The body's own, which it is or is a part of: with friction and density.
    """

    solid: CollisionShape
    of: Shape


@dataclass(frozen=True, eq=False)
class BodyLink:
    """What moves in one piece.

    Attributes:
        name: Of the body, or of the part of it that a joint moves, as the task knows it.
        pose: Of its frame in the world, (4, 4) (m).
        shapes: What it is made of, in that frame; each that collides has friction.
    """

    name: str
    pose: Floats
    shapes: tuple[Shape, ...]

    @property
    def collides(self) -> bool:
        """Whether anything of it does."""
        return any(shape.collides for shape in self.shapes)

    def framed_at(self, place: Floats) -> BodyLink:
        """Return it with its frame at a place of that frame, (3,) (m)."""
        pose = self.pose.copy()
        pose[:3, 3] += pose[:3, :3] @ place
        moved = (tuple((np.array(shape.position) - place).tolist()) for shape in self.shapes)
        shapes = zip(self.shapes, moved, strict=True)
        return BodyLink(self.name, pose, tuple(replace(s, position=at) for s, at in shapes))

    @cached_property
    def drawn(self) -> tuple[Drawn, ...]:
        """What is drawn of it; meshes of very many triangles are made coarser.

        Raises:
            AssetError: If a mesh file cannot be read.
        """
        parts = (part for shape in self.shapes if shape.visible for part in _drawn(shape))
        return tuple(Drawn(part.mesh, part.rgba) for part in map(simplified, parts))

    def solids(self, hulls: Sequence[str] = AS_HULLS) -> Iterator[BodyShape]:
        """Yield what collides.

        Args:
            hulls: Kinds of shapes that are given as their convex hulls.

        Raises:
            AssetError: If a mesh file cannot be read, or has no volume.
        """
        for shape in self.shapes:
            for solid in _solids(shape, hulls) if shape.collides else ():
                yield BodyShape(solid, shape)

    @property
    def inertia(self) -> LinkInertia:
        """What it weighs.

        Raises:
            DescriptorError: If nothing of it has a volume.
        """
        whole, origin = mass_of(self.shapes), np.eye(4)
        origin[:3, 3] = whole.centre
        return LinkInertia(whole.mass, origin, inertia_of(self.shapes, whole.centre))


@dataclass(frozen=True, eq=False)
class BodyJoint:
    """A joint of a body, between two of its links.

    Attributes:
        model: The joint; its frame is turned as those of the links are.
        anchor: Where it is in the frame of the link that it moves, (3,) (m).
        drive: Its spring, of which the force has no end, its damper, and PhysX's coefficient of
            dry friction.
        rest: Where that spring is slack (m, rad).
        position: Where it is (m, rad).
    """

    model: ModelJoint
    anchor: Floats
    drive: JointDrive
    rest: float
    position: float


@dataclass(frozen=True, eq=False)
class ExportedBody:
    """A body, as it is at a moment.

    Attributes:
        name: As the task knows it.
        moves: Whether physics moves it; else it is held where it is, and its joints move all the
            same.
        stands: Whether nothing ever moves it, not even the task.
        marker: Whether it is there for people only.
        links: What it is made of, that which carries all others first.
        joints: Between them.
    """

    name: str
    moves: bool
    stands: bool
    marker: bool
    links: tuple[BodyLink, ...]
    joints: tuple[BodyJoint, ...] = ()

    @property
    def collides(self) -> bool:
        """Whether anything of it does."""
        return any(link.collides for link in self.links)


@dataclass(frozen=True, eq=False)
class ExportedWorld:
    """What there is besides robots in a task's world.

    Attributes:
        bodies: Its bodies.
        things: What some of them are made after.
        gravity: Acceleration (m/s²).
    """

    bodies: tuple[ExportedBody, ...] = ()
    things: tuple[ObjectDescriptor, ...] = ()
    gravity: Vector3 = EARTH


NOTHING = ExportedWorld()


def body_joint(body: str, joint: Joint, carrier: Joint | None, position: float) -> BodyJoint:
    """Return a joint of a body.

    Args:
        body: The body's name.
        joint: As it is declared.
        carrier: The joint whose part carries it; None if the body's first link does.
        position: Where it is (m, rad).
    """
    before = (0.0, 0.0, 0.0) if carrier is None else carrier.origin
    origin = np.eye(4)
    origin[:3, 3] = np.subtract(joint.at, before)
    model = ModelJoint(
        name=f"{body}.{joint.name}",
        type="continuous" if joint.is_endless else _KINDS[joint.kind],
        parent=body if carrier is None else f"{body}.{carrier.name}",
        child=f"{body}.{joint.name}",
        origin=origin,
        axis=joint.axis,
        lower=joint.lower,
        upper=joint.upper,
        effort=None,
        velocity=None,
        mimics=None,
    )
    drive = JointDrive(joint.stiffness, joint.damping, inf, 0.0, joint.friction)
    return BodyJoint(model, np.subtract(joint.at, joint.origin), drive, joint.rest, position)


def _solids(shape: Shape, hulls: Sequence[str]) -> Iterator[CollisionShape]:
    origin, name = pose_matrix(shape.position, shape.quaternion), type(shape).__name__
    turned = pose_matrix(shape.position, multiplied(shape.quaternion, _ALONG_X))
    match shape:
        case Box(half_size=(x, y, z)):
            own = UrdfShape("box", (2 * x, 2 * y, 2 * z), "", origin, name)
        case Sphere():
            own = UrdfShape("sphere", (shape.radius,), "", origin, name)
        case Cylinder() | Capsule():
            sizes = (shape.radius, 2 * shape.half_length)
            own = UrdfShape(name.lower(), sizes, "", turned, name)
        case Plane():
            own = UrdfShape(PLANE, (), "", origin, name)
        case _:
            own = UrdfShape("mesh", (1.0, 1.0, 1.0), "", origin, name)
    if own.kind not in hulls:
        yield CollisionShape(own, None)
    elif isinstance(shape, Mesh) and shape.collision != "hull":
        yield from _mesh_solids(shape, own)
    else:
        yield CollisionShape(own, hull_of(surface(shape).corners, name))


def _mesh_solids(mesh: Mesh, own: UrdfShape) -> Iterator[CollisionShape]:
    import trimesh

    file = str(mesh.path)
    read_corners(file, mesh.scale, file, file)  # what cannot be read is refused as a hull is
    if mesh.collision == "surface":
        found = surface(mesh)
        whole = trimesh.Trimesh(found.corners, found.triangles, process=False)
        yield CollisionShape(own, whole, convex=False)
        return
    turn, place = own.origin[:3, :3], own.origin[:3, 3]
    for corners in pieces(file, mesh.scale):
        yield CollisionShape(own, hull_of(corners @ turn.T + place, file))


def _drawn(shape: Shape) -> Iterator[Visual]:
    import trimesh

    color = shown_color(shape.color)
    if isinstance(shape, Floor | Plane):
        if isinstance(shape, Floor):
            yield _square(shape, shape.size / 2, color)
    elif isinstance(shape, Mesh):
        file, pose = str(shape.path), pose_matrix(shape.position, shape.quaternion)
        for mesh in load_meshes(file, file):
            mesh.apply_transform(pose @ np.diag([*shape.scale, 1.0]))
            yield Visual(mesh, mean_color(mesh) if shape.textured else color)
    else:
        found = surface(shape)
        yield Visual(trimesh.Trimesh(found.corners, found.triangles, process=False), color)


def _square(shape: Shape, half: float, rgba: Rgba) -> Visual:
    import trimesh

    corners = np.array([(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0)])
    corners = np.vstack([corners, (-half, half, 0.0)])
    made = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
    made.apply_transform(pose_matrix(shape.position, shape.quaternion))
    return Visual(made, rgba)
