"""Prims of a USD stage: meshes, plain shapes, masses, surfaces, cameras and joints.

Importing this needs usd-core.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from layouts.export.cell import RobotSource
from layouts.export.meshes import CollisionShape, Drawn
from robot_layouts.core.importing import optional
from robot_layouts.kinematics.rotations import Floats, pose_matrix, quaternion_of
from robots import CameraMount, GripperMaterial
from robots.urdf.model import LinkInertia, ModelJoint

# From a camera that looks along +x, z up, to USD's, which looks along -z, y up (wxyz).
LOOKING = (0.5, 0.5, -0.5, -0.5)
APERTURE = 20.955  # of USD's cameras, unless they say otherwise; tenths of a unit


def _pxr(name: str) -> Any:
    return optional(f"pxr.{name}", "USD stages need usd-core", "usd")


Gf, Sdf, Usd, UsdGeom = map(_pxr, ("Gf", "Sdf", "Usd", "UsdGeom"))
UsdPhysics, UsdShade, Vt = map(_pxr, ("UsdPhysics", "UsdShade", "Vt"))


def place(xformable: Any, pose: Floats, scale: Floats | None = None) -> None:
    """Put a prim somewhere in the frame of the one above it.

    Args:
        xformable: The prim.
        pose: (4, 4) (m).
        scale: What it is scaled by first, (3,).
    """
    matrix = pose if scale is None else pose @ np.diag([*scale, 1.0])
    xformable.MakeMatrixXform().Set(Gf.Matrix4d(*matrix.T.flatten().tolist()))


def quaternion(rotation: Floats) -> Any:
    """Return a rotation matrix, (3, 3), as a quaternion of single precision."""
    w, x, y, z = quaternion_of(rotation).tolist()
    return Gf.Quatf(w, x, y, z)


def add_drawn(stage: Any, path: str, drawn: Drawn) -> None:
    """Define a mesh that is only drawn."""
    mesh = _mesh(stage, path, drawn.mesh)
    red, green, blue, alpha = drawn.rgba
    mesh.CreateDisplayColorAttr([(red, green, blue)])
    mesh.CreateDisplayOpacityAttr([alpha])


def add_solid(stage: Any, path: str, solid: CollisionShape) -> None:
    """Define a shape that collides and is not drawn."""
    shape = solid.shape
    if solid.hull is not None:
        made = _mesh(stage, path, solid.hull)
        api = UsdPhysics.MeshCollisionAPI.Apply(made.GetPrim())
        api.CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    elif shape.kind == "box":
        made = UsdGeom.Cube.Define(stage, path)
        made.CreateSizeAttr(1.0)
        place(made, shape.origin, np.array(shape.sizes))
    elif shape.kind == "sphere":
        made = UsdGeom.Sphere.Define(stage, path)
        made.CreateRadiusAttr(shape.sizes[0])
        place(made, shape.origin)
    else:
        kind = UsdGeom.Cylinder if shape.kind == "cylinder" else UsdGeom.Capsule
        made = kind.Define(stage, path)
        made.CreateRadiusAttr(shape.sizes[0])
        made.CreateHeightAttr(shape.sizes[1])
        made.CreateAxisAttr(UsdGeom.Tokens.z)
        place(made, shape.origin)
    made.CreatePurposeAttr(UsdGeom.Tokens.guide)
    UsdPhysics.CollisionAPI.Apply(made.GetPrim())


def add_box(stage: Any, path: str, pose: Floats, size: Floats) -> None:
    """Define a box that stands still, is drawn and collides.

    Args:
        stage: The stage.
        path: Of the box.
        pose: Of its middle, (4, 4) (m).
        size: (3,) (m).
    """
    made = UsdGeom.Cube.Define(stage, path)
    made.CreateSizeAttr(1.0)
    place(made, pose, size)
    UsdPhysics.CollisionAPI.Apply(made.GetPrim())


def set_inertia(prim: Any, inertial: LinkInertia) -> None:
    """Give a link mass and inertia."""
    moments, axes = np.linalg.eigh(inertial.tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(inertial.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*inertial.origin[:3, 3].tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(quaternion(axes))


def surface(stage: Any, path: str, material: GripperMaterial | None) -> Any:
    """Return the material of what grasps, which is defined if it is not yet."""
    made = UsdShade.Material.Define(stage, path)
    if material is not None:
        api = UsdPhysics.MaterialAPI.Apply(made.GetPrim())
        api.CreateStaticFrictionAttr(material.static_friction)
        api.CreateDynamicFrictionAttr(material.dynamic_friction)
        api.CreateRestitutionAttr(material.restitution)
    return made


def add_camera(stage: Any, path: str, camera: CameraMount) -> None:
    """Define a robot's camera."""
    made = UsdGeom.Camera.Define(stage, path)
    turn = pose_matrix((0.0, 0.0, 0.0), LOOKING)
    place(made, pose_matrix(camera.position, camera.quaternion) @ turn)
    height = APERTURE * camera.height / camera.width
    made.CreateHorizontalApertureAttr(APERTURE)
    made.CreateVerticalApertureAttr(height)
    made.CreateFocalLengthAttr(height / 2 / math.tan(camera.fov / 2))
    made.CreateClippingRangeAttr(Gf.Vec2f(camera.near, camera.far))


def _mesh(stage: Any, path: str, mesh: Any) -> Any:
    points = np.ascontiguousarray(mesh.vertices, np.float32)
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1)))
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    made.CreateExtentAttr([points.min(axis=0).tolist(), points.max(axis=0).tolist()])
    return made


def add_fixed_base(stage: Any, path: str, link: str, base: Floats) -> None:
    """Define the joint that fixes a robot to the world.

    Args:
        stage: The stage.
        path: Of the joint.
        link: Path of the root link.
        base: Pose of that link in the world, (4, 4) (m).
    """
    joint = UsdPhysics.FixedJoint.Define(stage, path)
    joint.CreateBody1Rel().SetTargets([link])
    _set_frames(joint, base, np.eye(3))


def add_joint(
    stage: Any,
    path: str,
    links: tuple[str, str],
    joint: ModelJoint,
    source: RobotSource,
    home: float,
) -> None:
    """Define a joint between two links, with its limits, and its drive if it follows no other.

    USD counts turns in degrees. Joints turn about or slide along the x axis of frames on both
    links.

    Args:
        stage: The stage.
        path: Of the joint.
        links: Paths of the link that carries it, and of the one that it carries.
        joint: The joint.
        source: Its robot.
        home: Its position where the layout starts the robot (rad or m).
    """
    kinds: dict[str, Any] = {
        "fixed": UsdPhysics.FixedJoint,
        "prismatic": UsdPhysics.PrismaticJoint,
    }
    made = kinds.get(joint.type, UsdPhysics.RevoluteJoint).Define(stage, path)
    made.CreateBody0Rel().SetTargets([links[0]])
    made.CreateBody1Rel().SetTargets([links[1]])
    prim = made.GetPrim()
    prim.SetDisplayName(joint.name)
    if not joint.moves:
        _set_frames(made, joint.origin, np.eye(3))
        return
    made.CreateAxisAttr(UsdPhysics.Tokens.x)
    _set_frames(made, joint.origin, _along(joint.axis))
    unit = _per_unit(joint)
    if joint.lower is not None and joint.upper is not None:
        made.CreateLowerLimitAttr(joint.lower * unit)
        made.CreateUpperLimitAttr(joint.upper * unit)
    way = "linear" if joint.type == "prismatic" else "angular"
    prim.AddAppliedSchema(f"PhysicsJointStateAPI:{way}")
    set_attribute(prim, f"state:{way}:physics:position", "Float", home * unit)
    prim.AddAppliedSchema("PhysxJointAPI")
    if joint.velocity:
        set_attribute(prim, "physxJoint:maxJointVelocity", "Float", joint.velocity * unit)
    drive = source.drives.get(joint.name)
    if drive is not None and drive.armature:
        set_attribute(prim, "physxJoint:armature", "Float", drive.armature)
    if drive is not None and drive.friction:
        set_attribute(prim, "physxJoint:jointFriction", "Float", drive.friction)
    if joint.name in source.leaders:
        drive = source.drives[joint.name]
        api = UsdPhysics.DriveAPI.Apply(prim, way)
        api.CreateTypeAttr(UsdPhysics.Tokens.force)
        api.CreateStiffnessAttr(drive.stiffness / unit)
        api.CreateDampingAttr(drive.damping / unit)
        api.CreateMaxForceAttr(drive.force)
        api.CreateTargetPositionAttr(home * unit)


def tie(prim: Any, leader: str, joint: ModelJoint) -> None:
    """Make a joint follow another one, as PhysX reads it: own + gearing · other + offset = 0.

    Args:
        prim: The joint's prim.
        leader: Path of the joint that it follows.
        joint: The joint.
    """
    mimic = "physxMimicJoint:rotX"
    prim.AddAppliedSchema("PhysxMimicJointAPI:rotX")
    set_attribute(prim, f"{mimic}:gearing", "Float", -joint.multiplier)
    set_attribute(prim, f"{mimic}:offset", "Float", -joint.offset * _per_unit(joint))
    prim.CreateRelationship(f"{mimic}:referenceJoint").SetTargets([leader])
    set_attribute(prim, f"{mimic}:referenceJointAxis", "Token", "rotX")


def set_attribute(prim: Any, name: str, kind: str, value: Any) -> None:
    """Give a prim an attribute of no schema, of a kind such as ``"Float"``."""
    prim.CreateAttribute(name, getattr(Sdf.ValueTypeNames, kind)).Set(value)


def _per_unit(joint: ModelJoint) -> float:
    """Return how many of USD's units are one of a joint's: degrees per rad, or 1."""
    return 1.0 if joint.unit == "m" else math.degrees(1.0)


def _set_frames(joint: Any, origin: Floats, turned: Floats) -> None:
    """Set a joint's frames on both links, the second at that link's origin."""
    joint.CreateLocalPos0Attr(Gf.Vec3f(*origin[:3, 3].tolist()))
    joint.CreateLocalRot0Attr(quaternion(origin[:3, :3] @ turned))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0.0, 0.0, 0.0))
    joint.CreateLocalRot1Attr(quaternion(turned))


def _along(axis: tuple[float, float, float]) -> Floats:
    """Return a rotation whose x axis lies along an axis of length 1, (3, 3)."""
    x = np.array(axis)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])
