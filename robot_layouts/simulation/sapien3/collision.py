"""What bodies collide with: turns shapes into SAPIEN's, and reads those back as plain numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import sapien
import sapien.physx as physx

from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Plane, Shape, Sphere

# What a collision shape may have, besides its place in the body.
_SIZES = ("half_size", "radius", "half_length", "scale", "vertices", "triangles")


def add_collision(builder: Any, shape: Shape) -> None:
    """Add a shape to a SAPIEN actor builder, if it takes part in contacts and is no hull."""
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
            add = builder.add_convex_collision_from_file
            sizes = {"filename": str(shape.file), "scale": list(shape.scale)}
        case _:
            raise TypeError(f"no collision for {type(shape).__name__}")
    add(density=shape.density, **common, **sizes)


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
