"""A task's bodies in MuJoCo's description of a model."""

from __future__ import annotations

from typing import Any

import numpy as np

from objects.joints import Joint
from objects.shapes import (
    Box,
    Capsule,
    ConvexHull,
    Cylinder,
    Friction,
    Mesh,
    Plane,
    Shape,
    Sphere,
)
from robot_layouts.kinematics.rotations import Floats, multiply
from robot_layouts.simulation.mujoco.library import mujoco
from robot_layouts.simulation.world import WorldBody, part_name
from robots.urdf.mesh_files import read_corners

PREFIX = "/"  # of bodies' names, which no place of a layout begins with
# MuJoCo's planes face along +z, its cylinders and capsules lie along it; ours along +x (wxyz).
_ALONG_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
_TYPES: dict[type[Shape], Any] = {
    Box: mujoco.mjtGeom.mjGEOM_BOX,
    Sphere: mujoco.mjtGeom.mjGEOM_SPHERE,
    Cylinder: mujoco.mjtGeom.mjGEOM_CYLINDER,
    Capsule: mujoco.mjtGeom.mjGEOM_CAPSULE,
    Plane: mujoco.mjtGeom.mjGEOM_PLANE,
    ConvexHull: mujoco.mjtGeom.mjGEOM_MESH,
    Mesh: mujoco.mjtGeom.mjGEOM_MESH,
}
_KINDS = {"slide": mujoco.mjtJoint.mjJNT_SLIDE, "turn": mujoco.mjtJoint.mjJNT_HINGE}
_WEIGHTLESS = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0], "explicitinertial": True}


def add_body(spec: Any, body: WorldBody, friction: Friction, solref: list[float]) -> None:
    """Add a body and the parts that its joints move.

    Args:
        spec: MuJoCo's description of the model.
        body: What a task declared.
        friction: Of shapes that name none.
        solref: How soft its contacts are, in MuJoCo's numbers.
    """
    moves = body.kind == "dynamic"
    held = {} if moves and _has_mass(body.shapes) else _WEIGHTLESS
    made = spec.worldbody.add_body(
        name=PREFIX + body.name, pos=body.position, quat=body.quaternion, mocap=not moves, **held
    )
    if moves:
        made.add_freejoint(name=PREFIX + body.name)
    _add_shapes(spec, made, body.shapes, friction, solref)
    parts: dict[str | None, Any] = {None: made}
    for joint in body.joints:
        part = parts[joint.carrier].add_body(name=PREFIX + part_name(body.name, joint.name))
        # What a joint joins does not collide.
        spec.add_exclude(bodyname1=parts[joint.carrier].name, bodyname2=part.name)
        part.add_joint(name=part.name, **_joint_numbers(joint, solref))
        _add_shapes(spec, part, joint.parts, friction, solref)
        parts[joint.name] = part


def _has_mass(shapes: tuple[Shape, ...]) -> bool:
    return any(shape.collides and not isinstance(shape, Plane) for shape in shapes)


def _joint_numbers(joint: Joint, solref: list[float]) -> dict[str, Any]:
    return {
        "type": _KINDS[joint.kind],
        "axis": joint.axis,
        "pos": joint.at,
        "range": [joint.lower, joint.upper],
        "stiffness": joint.stiffness,
        "springref": joint.rest,
        "damping": joint.damping,
        "frictionloss": joint.friction,
        "solref_limit": solref,
    }


def _add_shapes(
    spec: Any, body: Any, shapes: tuple[Shape, ...], friction: Friction, solref: list[float]
) -> None:
    for shape in shapes:
        if not shape.collides:
            continue
        own = friction if shape.friction is None else shape.friction
        body.add_geom(
            type=_TYPES[type(shape)],
            pos=shape.position,
            quat=_turned(shape),
            density=shape.density,
            friction=[own.static, 0.005, 0.0001],
            solref=solref,
            **_size(spec, shape),
        )


def _turned(shape: Shape) -> Floats:
    along = isinstance(shape, (Cylinder, Capsule, Plane))
    return multiply(shape.quaternion, _ALONG_X) if along else np.array(shape.quaternion)


def _size(spec: Any, shape: Shape) -> dict[str, Any]:
    match shape:
        case Box():
            return {"size": shape.half_size}
        case Sphere():
            return {"size": [shape.radius, 0.0, 0.0]}
        case Cylinder() | Capsule():
            return {"size": [shape.radius, shape.half_length, 0.0]}
        case Plane():
            return {"size": [0.0, 0.0, 1.0]}
        case ConvexHull():
            return {"meshname": _add_hull(spec, np.array(shape.corners))}
        case Mesh():
            corners = read_corners(str(shape.file), shape.scale, str(shape.file), str(shape.file))
            return {"meshname": _add_hull(spec, corners)}
        case _:
            raise TypeError(f"no geom for {type(shape).__name__}")


def _add_hull(spec: Any, corners: Floats) -> str:
    name = f"{PREFIX}hull{len(spec.meshes)}"
    spec.add_mesh(
        name=name,
        uservert=corners.ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    return name
