"""A task's bodies in SAPIEN: rigid ones, and those whose joints move parts of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sapien
import sapien.physx as physx
from numpy.typing import NDArray
from sapien.wrapper.articulation_builder import ArticulationBuilder

from objects.joints import Joint
from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Place, Plane, Shape, Sphere
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.sapien3.blueprint import FLOOR
from robot_layouts.simulation.sapien3.builder import joint_frame
from robot_layouts.simulation.world import WorldBody, part_name
from robots import AssetError
from robots.urdf.mesh_files import has_body

_STILL = np.zeros(3, np.float32)
_KINDS = {"slide": "prismatic", "turn": "revolute_unwrapped"}
_ORIGIN = (0.0, 0.0, 0.0)


@dataclass(eq=False)
class BuiltBody:
    """A rigid body in SAPIEN.

    Attributes:
        declared: What the task declared.
        entity: SAPIEN's entity.
        component: Its physics component.
        start_pose: Pose it was built at.
    """

    declared: WorldBody
    entity: sapien.Entity
    component: Any
    start_pose: sapien.Pose

    def set_pose(self, pose: sapien.Pose) -> None:
        """Move it."""
        self.entity.set_pose(pose)

    def stop(self) -> None:
        """Zero its velocities, if physics moves it."""
        if self.declared.kind == "dynamic":
            self.component.set_linear_velocity([0.0, 0.0, 0.0])
            self.component.set_angular_velocity([0.0, 0.0, 0.0])

    def restore(self, row: NDArray[np.float32]) -> None:
        """Take over a state row: pose (m, wxyz), linear (m/s) and angular velocity (rad/s)."""
        self.set_pose(sapien.Pose(row[:3].tolist(), row[3:7].tolist()))
        if self.declared.kind == "dynamic":
            self.component.set_linear_velocity(row[7:10])
            self.component.set_angular_velocity(row[10:13])


class BuiltPart(BuiltBody):
    """What a joint of a body moves; it goes where its body and the joints say."""

    def set_pose(self, pose: sapien.Pose) -> None:
        """Leave it to its body."""

    def stop(self) -> None:
        """Leave it to its body."""


class JointedBody(BuiltBody):
    """A body with joints: an articulation, whose root is held unless physics moves the body.

    Attributes:
        articulation: SAPIEN's articulation.
    """

    def __init__(self, declared: WorldBody, articulation: Any, pose: sapien.Pose) -> None:
        """Take what was built, with its joints where they start."""
        root = articulation.links[0]
        super().__init__(declared, root.entity, root, pose)
        self.articulation = articulation
        active = [joint.name for joint in articulation.active_joints]
        self._order = [active.index(joint.name) for joint in declared.joints]
        for joint, built in zip(declared.joints, self._ordered(), strict=True):
            built.set_drive_properties(joint.stiffness, joint.damping)
            built.set_drive_target(joint.rest)
            built.set_friction(joint.friction)
        self.stop()

    def _ordered(self) -> list[Any]:
        active = self.articulation.active_joints
        return [active[i] for i in self._order]

    @property
    def joints(self) -> Floats:
        """Positions, then velocities of its joints, (2 · joints,) (m, rad, and per s)."""
        qpos, qvel = self.articulation.qpos, self.articulation.qvel
        return np.concatenate([qpos[self._order], qvel[self._order]])

    def set_pose(self, pose: sapien.Pose) -> None:
        """Move its root; its joints stay where they are."""
        self.articulation.set_root_pose(pose)

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Move some of its joints, at rest."""
        joints = self.joints[: len(self._order)]
        for i, joint in enumerate(self.declared.joints):
            joints[i] = positions.get(joint.name, joints[i])
        self._set(joints, np.zeros_like(joints))

    def stop(self) -> None:
        """Put its joints where they start, and zero all velocities."""
        start = np.array([joint.start for joint in self.declared.joints], np.float32)
        self._set(start, np.zeros_like(start))
        self.articulation.set_root_linear_velocity(_STILL)
        self.articulation.set_root_angular_velocity(_STILL)

    def restore(self, row: NDArray[np.float32]) -> None:
        """Take over a state row: that of a rigid body, then positions and velocities of joints."""
        self.articulation.set_root_pose(sapien.Pose(row[:3].tolist(), row[3:7].tolist()))
        self.articulation.set_root_linear_velocity(row[7:10])
        self.articulation.set_root_angular_velocity(row[10:13])
        self._set(*np.split(row[13:], 2))

    def _set(self, qpos: Floats, qvel: Floats) -> None:
        active = np.empty((2, len(self._order)), np.float32)
        active[:, self._order] = qpos, qvel
        self.articulation.set_qpos(active[0])
        self.articulation.set_qvel(active[1])
        self.articulation.set_qf(np.zeros_like(active[0]))


def build_bodies(scene: sapien.Scene, body: WorldBody, *, visuals: bool) -> Iterator[BuiltBody]:
    """Build a body, and the parts that its joints move.

    Args:
        scene: SAPIEN's scene.
        body: What a task declared.
        visuals: Whether to build what pictures need.
    """
    pose = sapien.Pose(list(body.position), list(body.quaternion))
    if not body.joints:
        yield _rigid(scene, body, pose, visuals=visuals)
        return
    articulation = _articulation(scene, body, pose)
    links = {link.name: link for link in articulation.links}
    for name, shapes in _links(body):
        _finish(links[name].entity, links[name], shapes, visuals=visuals)
    yield JointedBody(body, articulation, pose)
    for joint in body.joints:
        name = part_name(body.name, joint.name)
        declared = WorldBody(name, joint.own_parts, marker=body.marker, part_of=body.name)
        yield BuiltPart(declared, links[name].entity, links[name], links[name].entity.pose)


def _rigid(scene: sapien.Scene, body: WorldBody, pose: sapien.Pose, *, visuals: bool) -> BuiltBody:
    builder = scene.create_actor_builder()
    for shape in body.shapes:
        add_collision(builder, shape)
    builder.set_physx_body_type(body.kind)
    builder.set_initial_pose(pose)
    entity = builder.build(body.name)
    component: Any = entity.find_component_by_type(
        physx.PhysxRigidStaticComponent
        if body.kind == "static"
        else physx.PhysxRigidDynamicComponent
    )
    _finish(entity, component, body.shapes, visuals=visuals)
    for shape in component.collision_shapes:
        if isinstance(shape, physx.PhysxCollisionShapePlane):
            shape.set_collision_groups([*FLOOR, 0, 0])
    return BuiltBody(body, entity, component, pose)


def _articulation(scene: sapien.Scene, body: WorldBody, pose: sapien.Pose) -> Any:
    builder: Any = ArticulationBuilder()
    builder.set_initial_pose(pose)
    made: dict[str | None, Any] = {}
    origins = {None: _ORIGIN, **{joint.name: joint.origin for joint in body.joints}}
    for joint, (name, shapes) in zip((None, *body.joints), _links(body), strict=True):
        link = builder.create_link_builder(joint and made[joint.carrier])
        made[joint and joint.name] = link
        link.set_name(name)
        for shape in shapes:
            add_collision(link, shape)
        if joint is None:
            held = "undefined" if body.kind == "dynamic" else "fixed"
            link.set_joint_properties(held, [], sapien.Pose(), sapien.Pose())
        else:
            link.set_joint_name(joint.name)
            limits = [list(joint.limits)]
            carrier = origins[joint.carrier]
            frames = _joint_frame(joint, carrier), _joint_frame(joint, joint.origin)
            kind = "revolute" if joint.is_endless else _KINDS[joint.kind]
            link.set_joint_properties(kind, limits, *frames)
    articulation = builder.set_scene(scene).build()
    articulation.name = body.name
    return articulation


def _joint_frame(joint: Joint, origin: Place) -> sapien.Pose:
    """Return the pose of a joint's frame in that of a link which begins at ``origin`` (m)."""
    x, y, z = (at - begun for at, begun in zip(joint.at, origin, strict=True))
    if joint.axes is not None:
        return sapien.Pose([x, y, z], list(joint.axes))
    return joint_frame(joint.axis, (x, y, z))


def _links(body: WorldBody) -> list[tuple[str, tuple[Shape, ...]]]:
    """Return the names and shapes of a jointed body's links, its root's first."""
    parts = [(part_name(body.name, joint.name), joint.own_parts) for joint in body.joints]
    return [(body.name, body.shapes), *parts]


def _finish(
    entity: sapien.Entity, component: Any, shapes: tuple[Shape, ...], *, visuals: bool
) -> None:
    """Give an entity what pictures need, and the hulls that SAPIEN's builder cannot make."""
    if visuals:
        from robot_layouts.simulation.sapien3.visuals import visual_component

        drawn = visual_component(shapes)
        if drawn is not None:
            entity.add_component(drawn)
    attach_hulls(component, shapes)


# What a collision shape may have, besides its place in the body.
_SIZES = ("half_size", "radius", "half_length", "scale", "vertices", "triangles")


def add_collision(builder: Any, shape: Shape) -> None:
    """Add a shape to a SAPIEN actor builder, if it takes part in contacts and is no hull.

    Raises:
        AssetError: If the file of a mesh cannot be read, or is empty or flat.
    """
    if not shape.collides or isinstance(shape, ConvexHull):
        return
    common: dict[str, Any] = {"pose": _pose(shape), "material": _material(shape)}
    match shape:
        case Plane():
            builder.add_plane_collision(**common)
            return
        case Box():
            add, sizes = builder.add_box_collision, {"half_size": list(shape.half_size)}
        case Sphere():
            add, sizes = builder.add_sphere_collision, {"radius": shape.radius}
        case Cylinder():
            add, sizes = builder.add_cylinder_collision, _round_sizes(shape)
        case Capsule():
            add, sizes = builder.add_capsule_collision, _round_sizes(shape)
        case Mesh():
            file, add = str(shape.path), getattr(builder, _MESHES[shape.collision])
            if not has_body(file, shape.scale, file, file):
                raise AssetError(f"{file}: the mesh is flat, so that it cannot collide")
            sizes = {"filename": file, "scale": list(shape.scale)}
        case _:
            raise TypeError(f"no collision for {type(shape).__name__}")
    patch = {"patch_radius": shape.patch_radius, "min_patch_radius": shape.min_patch_radius}
    add(density=shape.density, **common, **patch, **sizes)


# SAPIEN's builder's methods.
_MESHES = {
    "hull": "add_convex_collision_from_file",
    "pieces": "add_multiple_convex_collisions_from_file",
    "surface": "add_nonconvex_collision_from_file",
}


def attach_hulls(component: Any, shapes: tuple[Shape, ...]) -> None:
    """Attach the hulls of a body to what SAPIEN built of its other shapes.

    SAPIEN's builder takes hulls from files alone; PhysX takes their corners.
    """
    for shape in shapes:
        if isinstance(shape, ConvexHull) and shape.collides:
            corners = np.array(shape.corners, np.float32)
            material = _material(shape) or physx.get_default_material()
            hull = physx.PhysxCollisionShapeConvexMesh(
                vertices=corners, scale=[1.0, 1.0, 1.0], material=material
            )
            hull.local_pose = _pose(shape)
            hull.set_density(shape.density)
            hull.set_patch_radius(shape.patch_radius)
            hull.set_min_patch_radius(shape.min_patch_radius)
            component.attach(hull)


def _pose(shape: Shape) -> sapien.Pose:
    return sapien.Pose(list(shape.position), list(shape.quaternion))


def _material(shape: Shape) -> physx.PhysxMaterial | None:
    if shape.friction is None:
        return None
    return physx.PhysxMaterial(
        static_friction=shape.friction.static,
        dynamic_friction=shape.friction.dynamic,
        restitution=shape.friction.restitution,
    )


def _round_sizes(shape: Cylinder | Capsule) -> dict[str, float]:
    return {"radius": shape.radius, "half_length": shape.half_length}


def described_shapes(component: Any) -> list[tuple[Any, ...]]:
    """Return the kind, pose and sizes of each collision shape of a body of SAPIEN's."""
    return [
        (
            type(shape).__name__,
            *np.concatenate([shape.local_pose.p, shape.local_pose.q]).tolist(),
            *(np.asarray(getattr(shape, size)).tolist() for size in _SIZES if hasattr(shape, size)),
        )
        for shape in component.collision_shapes
    ]
