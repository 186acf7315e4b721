"""A layout as one USD stage: articulations of UsdPhysics, with the attributes that PhysX reads.

Importing this needs usd-core.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from layouts.export.bodies import EARTH, NOTHING, PLANE, BodyLink, ExportedBody, ExportedWorld
from layouts.export.cell import ExportedCell, JointDrive, RobotSource, Standing
from layouts.export.files import Names, licence_note
from layouts.export.meshes import CollisionShape, Drawn, drawn_meshes, solid_shapes
from objects.shapes import Friction, Shape
from robot_layouts.core.importing import optional
from robot_layouts.core.writing import PARTIAL, written_whole
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix, quaternion_of
from robots import CameraMount, GripperMaterial
from robots.descriptor import Vector3
from robots.urdf.model import LinkInertia, ModelJoint

FORBIDDEN = r"[^A-Za-z0-9_]"
# From a camera that looks along +x, z up, to USD's, which looks along -z, y up (wxyz).
LOOKING = (0.5, 0.5, -0.5, -0.5)
ORIGIN = np.zeros(3)
APERTURE = 20.955  # of USD's cameras, unless they say otherwise; tenths of a unit


def _pxr(name: str) -> Any:
    return optional(f"pxr.{name}", "USD stages need usd-core", "usd")


Gf, Sdf, Usd, UsdGeom = map(_pxr, ("Gf", "Sdf", "Usd", "UsdGeom"))
UsdPhysics, UsdShade, Vt = map(_pxr, ("UsdPhysics", "UsdShade", "Vt"))


def write_usd(
    cell: ExportedCell, target: Path, around: ExportedWorld = NOTHING, *, visuals: bool = True
) -> Path:
    """Write a cell as a USD stage; see `layouts.Layout.to_usd` and `tasks.TaskEnv.to_usd`."""
    stage = _Stage(cell, around, _identifier(target.stem))
    for source in cell.sources:
        stage.add_shapes(source, visuals=visuals)
    stage.add_surroundings()
    for standing in cell.robots.values():
        stage.add_robot(standing)
    for body in around.bodies:
        stage.add_body(body)
    partial = target.with_name(f"{target.stem}.{os.getpid()}{PARTIAL}{target.suffix}")
    with written_whole(target, partial=partial):
        stage.save(partial)
    return target


def _identifier(name: str) -> str:
    plain = Names(FORBIDDEN).new(name)
    return f"_{plain}" if plain[:1].isdigit() or not plain else plain


class _Paths:
    """Paths of prims below another one, by the names that they have here."""

    def __init__(self, above: str, *taken: str) -> None:
        self.above, self._names = above, Names(FORBIDDEN)
        self._paths: dict[str, str] = {}
        for name in taken:
            self._names.new(name)

    def of(self, name: str) -> str:
        """Return the path of a prim, the same each time."""
        if name not in self._paths:
            self._paths[name] = f"{self.above}/{self._names.new(_identifier(name))}"
        return self._paths[name]


class _Stage:
    """A stage that grows robot by robot."""

    def __init__(self, cell: ExportedCell, around: ExportedWorld, name: str) -> None:
        self._cell, self._stage = cell, Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        UsdPhysics.SetStageKilogramsPerUnit(self._stage, 1.0)
        note = licence_note((source.robot for source in cell.sources), around.things)
        self._stage.GetRootLayer().documentation = note
        self._stage.SetMetadata("comment", "lengths in m, z up; see the documentation for licences")
        root = UsdGeom.Xform.Define(self._stage, f"/{name}").GetPrim()
        self._stage.SetDefaultPrim(root)
        self._paths = _Paths(f"/{name}", "scene", "tables", "frames", "surfaces", "bodies")
        self._bodies = _Paths(f"/{name}/bodies", "surfaces")
        add_scene(self._stage, f"/{name}/scene", around.gravity)
        self._surfaces: dict[Friction, Any] = {}
        library = f"/{name}_shapes"
        self._stage.CreateClassPrim(library)
        self._shapes = {
            id(source): _Paths(_Paths(library).of(source.name)) for source in cell.sources
        }

    def save(self, path: Path) -> None:
        """Write the stage."""
        self._stage.GetRootLayer().Export(path.as_posix())

    def add_shapes(self, source: RobotSource, *, visuals: bool) -> None:
        """Define what each link of a robot looks like and collides with, for all its places."""
        paths = self._shapes[id(source)]
        for link, meshes in drawn_meshes(source, visuals=visuals).items():
            for number, drawn in enumerate(meshes):
                add_drawn(self._stage, f"{paths.of(link)}/drawn/mesh_{number}", drawn)
        for link, solids in solid_shapes(source, ("mesh",)).items():
            for number, solid in enumerate(solids):
                add_solid(self._stage, f"{paths.of(link)}/solid/shape_{number}", solid)

    def add_surroundings(self) -> None:
        """Define tables and frames."""
        tables, frames = (_Paths(f"{self._paths.above}/{what}") for what in ("tables", "frames"))
        for name, (pose, size) in self._cell.tables.items():
            add_box(self._stage, tables.of(name), pose, size)
        for name, frame in self._cell.layout.frame_poses.items():
            made = UsdGeom.Xform.Define(self._stage, frames.of(name))
            place(made, pose_matrix(frame.position, frame.quaternion))

    def add_robot(self, standing: Standing) -> None:
        """Define a robot: its links where they are at home, and its joints."""
        source = standing.source
        prim = UsdGeom.Xform.Define(self._stage, self._paths.of(standing.place))
        place(prim, standing.base)
        UsdPhysics.ArticulationRootAPI.Apply(prim.GetPrim())
        prim.GetPrim().AddAppliedSchema("PhysxArticulationAPI")
        set_attribute(prim.GetPrim(), "physxArticulation:enabledSelfCollisions", "Bool", True)
        links = _Paths(str(prim.GetPath()), "joints")
        back = inverse_pose(standing.base)
        for link in source.model.links:
            self._add_link(source, link, links.of(link), back @ standing.poses[link])
        for one, other in sorted(sorted(pair) for pair in source.allowed):
            api = UsdPhysics.FilteredPairsAPI.Apply(self._stage.GetPrimAtPath(links.of(one)))
            api.CreateFilteredPairsRel().AddTarget(links.of(other))
        self._add_joints(standing, links)
        self._add_mounts(standing, links)

    def add_body(self, body: ExportedBody) -> None:
        """Define a body of a task where it is now, and its joints."""
        path = self._bodies.of(body.name)
        root, *others = body.links
        paths = {root.name: path}
        if body.joints:
            prim = UsdGeom.Xform.Define(self._stage, path).GetPrim()
            UsdPhysics.ArticulationRootAPI.Apply(prim)
            inside = _Paths(path, "joints")
            paths = {link.name: inside.of(link.name) for link in body.links}
        self._add_piece(root, paths[root.name], body)
        for link in others:
            self._add_piece(link, paths[link.name], replace(body, moves=True, stands=False))
        if not body.joints:
            return
        joints = _Paths(f"{path}/joints")
        self._stage.DefinePrim(joints.above, "Scope")
        if not body.moves:
            add_fixed_base(self._stage, joints.of("fixed"), paths[root.name], root.pose)
        for own in body.joints:
            joint = own.model
            ends = paths[joint.parent], paths[joint.child]
            add_joint(self._stage, joints.of(joint.name), ends, joint, own.position, own.anchor)
            prim = self._stage.GetPrimAtPath(joints.of(joint.name))
            add_losses(prim, own.drive)
            if own.drive.stiffness or own.drive.damping:
                add_drive(prim, joint, own.drive, own.rest)

    def _add_piece(self, link: BodyLink, path: str, body: ExportedBody) -> None:
        """Define a link of a body."""
        made = UsdGeom.Xform.Define(self._stage, path)
        prim = made.GetPrim()
        place(made, link.pose)
        prim.SetDisplayName(link.name)
        if not body.stands or body.joints:
            rigid = UsdPhysics.RigidBodyAPI.Apply(prim)
            rigid.CreateKinematicEnabledAttr(not body.moves and not body.joints)
        for number, drawn in enumerate(link.drawn):
            add_drawn(self._stage, f"{path}/drawn/mesh_{number}", drawn, guide=body.marker)
        for number, own in enumerate(link.solids(("mesh",))):
            solid = f"{path}/solid/shape_{number}"
            add_solid(self._stage, solid, own.solid)
            add_substance(self._stage.GetPrimAtPath(solid), own.of)
            bind(self._stage.GetPrimAtPath(solid), self._surface(own.of.friction or Friction()))

    def _surface(self, friction: Friction) -> Any:
        if friction not in self._surfaces:
            name = f"{self._bodies.above}/surfaces/surface_{len(self._surfaces)}"
            self._surfaces[friction] = surface(self._stage, name, friction)
        return self._surfaces[friction]

    def _add_link(self, source: RobotSource, link: str, path: str, pose: Floats) -> None:
        made = UsdGeom.Xform.Define(self._stage, path)
        prim = made.GetPrim()
        place(made, pose)
        prim.SetDisplayName(link)  # which may have letters that no path has
        UsdPhysics.RigidBodyAPI.Apply(prim)
        prim.AddAppliedSchema("PhysxRigidBodyAPI")
        set_attribute(prim, "physxRigidBody:disableGravity", "Bool", True)
        if link in source.inertials:
            set_inertia(prim, source.inertials[link])
        for kind in ("drawn", "solid"):
            shapes = f"{self._shapes[id(source)].of(link)}/{kind}"
            if self._stage.GetPrimAtPath(shapes):
                held = UsdGeom.Xform.Define(self._stage, f"{path}/{kind}").GetPrim()
                held.GetReferences().AddInternalReference(shapes)
                held.SetInstanceable(True)
        friction = source.friction_of(link)
        if friction is not None:
            name = f"{self._paths.above}/surfaces/{_identifier(source.name)}"
            bind(prim, surface(self._stage, name, source.robot.gripper_material))

    def _add_joints(self, standing: Standing, links: _Paths) -> None:
        source, joints = standing.source, _Paths(f"{links.above}/joints")
        self._stage.DefinePrim(joints.above, "Scope")
        add_fixed_base(
            self._stage, joints.of("fixed_to_world"), links.of(source.model.root), standing.base
        )
        for joint in source.model.ordered:
            ends = links.of(joint.parent), links.of(joint.child)
            home = standing.home.get(joint.name, 0.0)
            add_joint(self._stage, joints.of(joint.name), ends, joint, home)
            drive = source.drives.get(joint.name)
            if drive is not None and joint.moves:
                prim = self._stage.GetPrimAtPath(joints.of(joint.name))
                add_losses(prim, drive)
                if joint.name in source.leaders:
                    add_drive(prim, joint, drive, home)
        for joint in source.followers:
            prim = self._stage.GetPrimAtPath(joints.of(joint.name))
            tie(prim, joints.of(joint.mimics or ""), joint)

    def _add_mounts(self, standing: Standing, links: _Paths) -> None:
        """Define tool centre points and cameras, on the links that carry them."""
        for tool in self._cell.tools:
            if tool.place == standing.place:
                name = _identifier(f"tcp_{tool.arm}")
                made = UsdGeom.Xform.Define(self._stage, f"{links.of(tool.link)}/{name}")
                pose = np.eye(4)
                pose[:3, 3] = tool.position
                place(made, pose)
        for camera in standing.source.robot.cameras:
            path = f"{links.of(camera.link)}/camera_{_identifier(camera.name)}"
            add_camera(self._stage, path, camera)


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


def add_scene(stage: Any, path: str, gravity: Vector3) -> None:
    """Define which way things fall, and how fast (m/s²), where it is not as on Earth."""
    scene = UsdPhysics.Scene.Define(stage, path)
    if gravity == EARTH:
        return
    strength = math.hypot(*gravity)
    if strength:
        x, y, z = (along / strength for along in gravity)
        scene.CreateGravityDirectionAttr(Gf.Vec3f(x, y, z))
    scene.CreateGravityMagnitudeAttr(strength)


def add_drawn(stage: Any, path: str, drawn: Drawn, *, guide: bool = False) -> None:
    """Define a mesh that is only drawn; a guide is, where people look for it."""
    mesh = _mesh(stage, path, drawn.mesh)
    if guide:
        mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
    red, green, blue, alpha = drawn.rgba
    mesh.CreateDisplayColorAttr([(red, green, blue)])
    mesh.CreateDisplayOpacityAttr([alpha])


def add_solid(stage: Any, path: str, solid: CollisionShape) -> None:
    """Define a shape that collides and is not drawn."""
    shape = solid.shape
    if solid.mesh is not None:
        made = _mesh(stage, path, solid.mesh)
        api = UsdPhysics.MeshCollisionAPI.Apply(made.GetPrim())
        api.CreateApproximationAttr(
            UsdPhysics.Tokens.convexHull if solid.convex else UsdPhysics.Tokens.none
        )
    elif shape.kind == "box":
        made = UsdGeom.Cube.Define(stage, path)
        made.CreateSizeAttr(1.0)
        place(made, shape.origin, np.array(shape.sizes))
    elif shape.kind == PLANE:
        made = UsdGeom.Plane.Define(stage, path)
        made.CreateAxisAttr(UsdGeom.Tokens.x)
        place(made, shape.origin)
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


def surface(stage: Any, path: str, material: GripperMaterial | Friction | None) -> Any:
    """Return the material of what grasps or is grasped, which is defined if it is not yet."""
    made = UsdShade.Material.Define(stage, path)
    if material is None:
        return made
    if isinstance(material, Friction):
        static, dynamic = material.static, material.dynamic
    else:
        static, dynamic = material.static_friction, material.dynamic_friction
    api = UsdPhysics.MaterialAPI.Apply(made.GetPrim())
    api.CreateStaticFrictionAttr(static)
    api.CreateDynamicFrictionAttr(dynamic)
    api.CreateRestitutionAttr(material.restitution)
    return made


def bind(prim: Any, material: Any) -> None:
    """Give a prim, and what is below it, a material in contacts."""
    weaker = UsdShade.Tokens.weakerThanDescendants
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, weaker, "physics")


def add_substance(prim: Any, shape: Shape) -> None:
    """Say what a shape of a body is like inside, and how its contacts resist that it turns."""
    UsdPhysics.MassAPI.Apply(prim).CreateDensityAttr(shape.density)
    if shape.patch_radius or shape.min_patch_radius:
        prim.AddAppliedSchema("PhysxCollisionAPI")
        name = "physxCollision:{}orsionalPatchRadius"
        set_attribute(prim, name.format("t"), "Float", shape.patch_radius)
        set_attribute(prim, name.format("minT"), "Float", shape.min_patch_radius)


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
    position: float,
    anchor: Floats = ORIGIN,
) -> None:
    """Define a joint between two links, with its limits.

    USD counts turns in degrees. Joints turn about or slide along the x axis of frames on both
    links.

    Args:
        stage: The stage.
        path: Of the joint.
        links: Paths of the link that carries it, and of the one that it carries.
        joint: The joint.
        position: Where it is (rad or m).
        anchor: Where it is in the frame of the link that it carries, (3,) (m).
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
        _set_frames(made, joint.origin, np.eye(3), anchor)
        return
    made.CreateAxisAttr(UsdPhysics.Tokens.x)
    _set_frames(made, joint.origin, _along(joint.axis), anchor)
    unit = _per_unit(joint)
    if joint.lower is not None and joint.upper is not None:
        made.CreateLowerLimitAttr(joint.lower * unit)
        made.CreateUpperLimitAttr(joint.upper * unit)
    way = _way(joint)
    prim.AddAppliedSchema(f"PhysicsJointStateAPI:{way}")
    set_attribute(prim, f"state:{way}:physics:position", "Float", position * unit)
    prim.AddAppliedSchema("PhysxJointAPI")
    if joint.velocity:
        set_attribute(prim, "physxJoint:maxJointVelocity", "Float", joint.velocity * unit)


def add_losses(prim: Any, drive: JointDrive) -> None:
    """Give a joint the inertia of its motor, and friction."""
    if drive.armature:
        set_attribute(prim, "physxJoint:armature", "Float", drive.armature)
    if drive.friction:
        set_attribute(prim, "physxJoint:jointFriction", "Float", drive.friction)


def add_drive(prim: Any, joint: ModelJoint, drive: JointDrive, target: float) -> None:
    """Give a joint a spring, which pulls it towards a target (rad or m), and a damper."""
    unit = _per_unit(joint)
    api = UsdPhysics.DriveAPI.Apply(prim, _way(joint))
    api.CreateTypeAttr(UsdPhysics.Tokens.force)
    api.CreateStiffnessAttr(drive.stiffness / unit)
    api.CreateDampingAttr(drive.damping / unit)
    api.CreateMaxForceAttr(drive.force)
    api.CreateTargetPositionAttr(target * unit)


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


def _way(joint: ModelJoint) -> str:
    return "linear" if joint.type == "prismatic" else "angular"


def _set_frames(joint: Any, origin: Floats, turned: Floats, anchor: Floats = ORIGIN) -> None:
    """Set a joint's frames on both links, the second at a place of that link, (3,) (m)."""
    joint.CreateLocalPos0Attr(Gf.Vec3f(*origin[:3, 3].tolist()))
    joint.CreateLocalRot0Attr(quaternion(origin[:3, :3] @ turned))
    joint.CreateLocalPos1Attr(Gf.Vec3f(*anchor.tolist()))
    joint.CreateLocalRot1Attr(quaternion(turned))


def _along(axis: tuple[float, float, float]) -> Floats:
    """Return a rotation whose x axis lies along an axis of length 1, (3, 3)."""
    x = np.array(axis)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])
