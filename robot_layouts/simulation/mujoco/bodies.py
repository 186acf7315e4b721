"""A task's bodies in MuJoCo's description of a model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from layouts.visuals import load_meshes, mean_color, shown_color
from objects.files.mesh import convex_hulls
from objects.joints import Joint
from objects.shapes import (
    Box,
    Capsule,
    ConvexHull,
    Cylinder,
    Floor,
    Friction,
    Mesh,
    Plane,
    Shape,
    Sphere,
)
from objects.solids import pieces
from robot_layouts.kinematics.rotations import Floats, multiply
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.world import WorldBody, part_name
from robots import AssetError
from robots.urdf.mesh_files import read_corners


@dataclass(frozen=True, eq=False)
class _PieceHull(Shape):
    """The convex hull of a mesh's piece, of which there may be more corners than in `ConvexHull`.

    Attributes:
        corners: Points, (n, 3) (m).
    """

    corners: Any


HIDDEN = 3  # group of geoms that collide; see `DRAWN`
PREFIX = "/"  # of bodies' names, which no place of a layout begins with
# MuJoCo's planes face along +z, its cylinders and capsules lie along it; ours along +x (wxyz).
_ALONG_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
_TYPES: dict[type[Shape], Any] = {
    Box: mujoco.mjtGeom.mjGEOM_BOX,
    Sphere: mujoco.mjtGeom.mjGEOM_SPHERE,
    Cylinder: mujoco.mjtGeom.mjGEOM_CYLINDER,
    Capsule: mujoco.mjtGeom.mjGEOM_CAPSULE,
    Plane: mujoco.mjtGeom.mjGEOM_PLANE,
    Floor: mujoco.mjtGeom.mjGEOM_PLANE,
    ConvexHull: mujoco.mjtGeom.mjGEOM_MESH,
    Mesh: mujoco.mjtGeom.mjGEOM_MESH,
    _PieceHull: mujoco.mjtGeom.mjGEOM_MESH,
}
_KINDS = {"slide": mujoco.mjtJoint.mjJNT_SLIDE, "turn": mujoco.mjtJoint.mjJNT_HINGE}
_WEIGHTLESS = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0], "explicitinertial": True}


@dataclass(frozen=True, eq=False)
class BodyMaker:
    """Adds bodies to a model.

    Attributes:
        spec: MuJoCo's description of the model.
        friction: Of shapes that name none.
        solref: How soft contacts are, in MuJoCo's numbers.
        drawn: Whether to add what pictures need.
    """

    spec: Any
    friction: Friction
    solref: list[float]
    drawn: bool

    def add(self, body: WorldBody) -> None:
        """Add a body and the parts that its joints move."""
        moves = body.kind == "dynamic"
        held = {} if moves and _has_mass(body.shapes) else _WEIGHTLESS
        pose = {"pos": body.position, "quat": body.quaternion}
        made = self.spec.worldbody.add_body(
            name=PREFIX + body.name, mocap=not moves, **pose, **held
        )
        if moves:
            made.add_freejoint(name=PREFIX + body.name)
        self._add_shapes(made, body.shapes, marker=body.marker)
        parts: dict[str | None, Any] = {None: made}
        origins = {None: (0.0, 0.0, 0.0), **{joint.name: joint.origin for joint in body.joints}}
        for joint in body.joints:
            carrier = parts[joint.carrier]
            place = np.subtract(joint.origin, origins[joint.carrier])
            part = carrier.add_body(name=PREFIX + part_name(body.name, joint.name), pos=place)
            # What a joint joins does not collide.
            self.spec.add_exclude(bodyname1=carrier.name, bodyname2=part.name)
            part.add_joint(name=part.name, solref_limit=self.solref, **_joint_numbers(joint))
            self._add_shapes(part, joint.own_parts, marker=body.marker)
            parts[joint.name] = part

    def _add_shapes(self, body: Any, shapes: tuple[Shape, ...], *, marker: bool) -> None:
        for shape in shapes:
            if self.drawn and shape.visible:
                add_drawn(self.spec, body, shape, self._geom(shape), marker=marker)
            for solid in _solids(shape) if shape.collides else ():
                own = self.friction if shape.friction is None else shape.friction
                body.add_geom(
                    **self._geom(solid),
                    group=HIDDEN,
                    density=shape.density,
                    friction=[own.static, 0.005, 0.0001],
                    solref=self.solref,
                )

    def _geom(self, shape: Shape) -> dict[str, Any]:
        """Return type, pose and size of the geom that stands for a shape."""
        along = isinstance(shape, (Cylinder, Capsule, Plane))
        turned = multiply(shape.quaternion, _ALONG_X) if along else shape.quaternion
        return {
            "type": _TYPES[type(shape)],
            "pos": shape.position,
            "quat": turned,
            **self._size(shape),
        }

    def _size(self, shape: Shape) -> dict[str, Any]:
        match shape:
            case Box():
                return {"size": shape.half_size}
            case Sphere():
                return {"size": [shape.radius, 0.0, 0.0]}
            case Cylinder() | Capsule():
                return {"size": [shape.radius, shape.half_length, 0.0]}
            case Plane():
                return {"size": [0.0, 0.0, 1.0]}
            case Floor():
                return {"size": [shape.size / 2, shape.size / 2, 1.0]}
            case _PieceHull(corners=corners):
                return {"meshname": self._add_hull(corners)}
            case ConvexHull():
                return {"meshname": self._add_hull(np.array(shape.corners))}
            case Mesh() if shape.collides:
                file = str(shape.path)
                corners = read_corners(file, shape.scale, file, file)
                return {"meshname": self._add_hull(corners)}
            case _:  # a mesh that is only drawn
                return {}

    def _add_hull(self, corners: Floats) -> str:
        name = f"{PREFIX}hull{len(self.spec.meshes)}"
        inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        self.spec.add_mesh(name=name, uservert=corners.ravel().tolist(), inertia=inertia)
        return name


def _solids(shape: Shape) -> Iterator[Shape]:
    """Yield what stands for a shape that collides.

    In MuJoCo, which lets nothing but convex bodies collide, convex parts stand for a mesh's
    surface: its pieces if those are convex, else what CoACD makes of them.

    Raises:
        AssetError: If the file of a mesh cannot be read, or is empty or flat, or all its pieces.
        MissingPackageError: If its surface is hollow and the package coacd is not installed.
    """
    if not isinstance(shape, Mesh) or shape.collision == "hull":
        yield shape
        return
    file = str(shape.path)
    read_corners(file, shape.scale, file, file)  # what cannot be read is refused as a hull is
    if shape.collision == "surface":
        found = convex_hulls(file, shape.scale)
    elif not (found := pieces(file, shape.scale)):
        raise AssetError(f"{file}: no piece of the mesh that hangs together has a volume")
    for corners in found:
        yield _PieceHull(
            position=shape.position,
            quaternion=shape.quaternion,
            friction=shape.friction,
            density=shape.density,
            corners=corners,
        )


def _has_mass(shapes: tuple[Shape, ...]) -> bool:
    return any(shape.collides and not isinstance(shape, Plane) for shape in shapes)


def _joint_numbers(joint: Joint) -> dict[str, Any]:
    return {
        "type": _KINDS[joint.kind],
        "axis": joint.axis,
        "pos": np.subtract(joint.at, joint.origin),
        **({} if joint.is_endless else {"range": list(joint.limits)}),
        "stiffness": joint.stiffness,
        "springref": joint.rest,
        "damping": joint.damping,
    }


DRAWN, MARKERS = 2, 1  # groups of geoms: what all cameras see, and what people see alone
_SKY, _LAMPS = 0.45, ((1.0, 1.0, -1.0), (0.0, 0.0, -1.0))
_BRIGHT = 0.35  # of each lamp


def add_lamps(spec: Any, *, shadows: bool) -> None:
    """Light a model from everywhere, from the side and from above, as SAPIEN's worlds are."""
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [_SKY] * 3, [0.0] * 3
    for number, direction in enumerate(_LAMPS):
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=direction,
            diffuse=[_BRIGHT] * 3,
            specular=[0.0] * 3,
            castshadow=shadows and not number,
        )


def add_drawn(spec: Any, body: Any, shape: Shape, geom: dict[str, Any], *, marker: bool) -> None:
    """Add what is drawn of a shape.

    Args:
        spec: MuJoCo's description of the model.
        body: The body in it.
        shape: The shape.
        geom: Type, pose and size of the geom that stands for it.
        marker: Whether only people see it.

    Raises:
        AssetError: If its mesh file cannot be read.
    """
    ghost = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": MARKERS if marker else DRAWN}
    if not isinstance(shape, Mesh):
        body.add_geom(**geom, **ghost, rgba=shown_color(shape.color))
        return
    for mesh in load_meshes(str(shape.path), str(shape.path)):
        name = f"{body.name}/drawn{len(spec.meshes)}"
        spec.add_mesh(
            name=name,
            uservert=(np.asarray(mesh.vertices) * shape.scale).ravel().tolist(),
            userface=np.asarray(mesh.faces, int).ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        color = mean_color(mesh) if shape.textured else shown_color(shape.color)
        body.add_geom(**{**geom, "meshname": name}, **ghost, rgba=color)
