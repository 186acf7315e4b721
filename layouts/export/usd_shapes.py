"""Bodies of a USD stage: meshes, plain shapes, masses, surfaces and cameras."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from layouts.export.cell import Inertial
from layouts.export.meshes import Drawn, Solid
from layouts.export.usd_modules import usd_modules
from robot_layouts.kinematics.rotations import Floats, pose_matrix, quaternion_of
from robots import CameraMount, GripperMaterial

# From a camera that looks along +x, z up, to USD's, which looks along -z, y up (wxyz).
LOOKING = (0.5, 0.5, -0.5, -0.5)
APERTURE = 20.955  # of USD's cameras, unless they say otherwise; tenths of a unit


def place(xformable: Any, pose: Floats, scale: Floats | None = None) -> None:
    """Put a prim somewhere in the frame of the one above it.

    Args:
        xformable: The prim.
        pose: (4, 4) (m).
        scale: What it is scaled by first, (3,).
    """
    Gf = usd_modules("Gf")

    matrix = pose if scale is None else pose @ np.diag([*scale, 1.0])
    xformable.MakeMatrixXform().Set(Gf.Matrix4d(*matrix.T.flatten().tolist()))


def quaternion(rotation: Floats) -> Any:
    """Return a rotation matrix, (3, 3), as a quaternion of single precision."""
    Gf = usd_modules("Gf")

    w, x, y, z = quaternion_of(rotation).tolist()
    return Gf.Quatf(w, x, y, z)


def add_drawn(stage: Any, path: str, drawn: Drawn) -> None:
    """Define a mesh that is only drawn."""
    mesh = _mesh(stage, path, drawn.mesh)
    red, green, blue, alpha = drawn.rgba
    mesh.CreateDisplayColorAttr([(red, green, blue)])
    mesh.CreateDisplayOpacityAttr([alpha])


def add_solid(stage: Any, path: str, solid: Solid) -> None:
    """Define a shape that collides and is not drawn."""
    UsdGeom, UsdPhysics = usd_modules("UsdGeom", "UsdPhysics")

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
    UsdGeom, UsdPhysics = usd_modules("UsdGeom", "UsdPhysics")

    made = UsdGeom.Cube.Define(stage, path)
    made.CreateSizeAttr(1.0)
    place(made, pose, size)
    UsdPhysics.CollisionAPI.Apply(made.GetPrim())


def set_inertia(prim: Any, inertial: Inertial) -> None:
    """Give a link mass and inertia."""
    Gf, UsdPhysics = usd_modules("Gf", "UsdPhysics")

    moments, axes = np.linalg.eigh(inertial.tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(inertial.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*inertial.position.tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(quaternion(axes))


def surface(stage: Any, path: str, material: GripperMaterial | None) -> Any:
    """Return the material of what grasps, which is defined if it is not yet."""
    UsdPhysics, UsdShade = usd_modules("UsdPhysics", "UsdShade")

    made = UsdShade.Material.Define(stage, path)
    if material is not None:
        api = UsdPhysics.MaterialAPI.Apply(made.GetPrim())
        api.CreateStaticFrictionAttr(material.static_friction)
        api.CreateDynamicFrictionAttr(material.dynamic_friction)
        api.CreateRestitutionAttr(material.restitution)
    return made


def add_camera(stage: Any, path: str, camera: CameraMount) -> None:
    """Define a robot's camera."""
    Gf, UsdGeom = usd_modules("Gf", "UsdGeom")

    made = UsdGeom.Camera.Define(stage, path)
    turn = pose_matrix((0.0, 0.0, 0.0), LOOKING)
    place(made, pose_matrix(camera.position, camera.quaternion) @ turn)
    height = APERTURE * camera.height / camera.width
    made.CreateHorizontalApertureAttr(APERTURE)
    made.CreateVerticalApertureAttr(height)
    made.CreateFocalLengthAttr(height / 2 / math.tan(camera.fov / 2))
    made.CreateClippingRangeAttr(Gf.Vec2f(camera.near, camera.far))


def _mesh(stage: Any, path: str, mesh: Any) -> Any:
    UsdGeom, Vt = usd_modules("UsdGeom", "Vt")

    points = np.ascontiguousarray(mesh.vertices, np.float32)
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1)))
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    made.CreateExtentAttr([points.min(axis=0).tolist(), points.max(axis=0).tolist()])
    return made
