"""The bodies of a scene as obstacles to motions of arms."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Plane, Shape, Sphere
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform
from robot_layouts.motion.model.obstacles import Obstacle, box, cylinder, mesh, sphere
from robot_layouts.simulation.world import WorldBody

HALF_SPACE = 20.0  # m; edges of the box that stands for what is below a plane


def obstacles(scene: Scene) -> dict[str, Obstacle]:
    """Return all bodies that can be touched, where they are now, by their names.

    As obstacles they are called ``the cube``, so that no robot or table has the same name.

    Args:
        scene: The scene.
    """
    return {
        body.name: obstacle.moved(pose_matrix(*scene.body(body.name)))
        for body in scene.bodies
        if (obstacle := _obstacle(body)) is not None
    }


@lru_cache(maxsize=256)
def _obstacle(body: WorldBody) -> Obstacle | None:
    """Return a body anywhere, so that what is prepared for its shapes is so once; None of none."""
    shapes = tuple(_shapes(body))
    return Obstacle(f"the {body.name}", shapes) if shapes else None


def _shapes(body: WorldBody) -> Iterator[Floats]:
    for shape in body.shapes:
        if shape.collides:
            pose: Pose = np.array(shape.position), np.array(shape.quaternion)
            yield transform(pose_matrix(*pose), _corners(shape))


def _corners(shape: Shape) -> Floats:
    """Return the corners of the convex hull of a shape, in its own frame, (n, 3) (m)."""
    match shape:
        case Box():
            return _of(box("a box", [2 * half for half in shape.half_size]))
        case Sphere():
            return _of(sphere("a sphere", shape.radius))
        case Cylinder():
            return _along_x(_of(cylinder("a cylinder", shape.radius, 2 * shape.half_length)))
        case Capsule():
            ball = _of(sphere("a ball", shape.radius))
            ends = [ball + (side * shape.half_length, 0.0, 0.0) for side in (-1, 1)]
            return np.concatenate(ends)
        case ConvexHull():
            return np.array(shape.corners)
        case Mesh():
            return _of(mesh("a mesh", shape.path, scale=shape.scale))
        case Plane():
            below = (-HALF_SPACE / 2, 0.0, 0.0)
            return _of(box("a plane", [HALF_SPACE] * 3)) + below
        case _:
            raise TypeError(f"a {type(shape).__name__} collides with nothing")


def _of(obstacle: Obstacle) -> Floats:
    return obstacle.shapes[0]


def _along_x(corners: Floats) -> Floats:
    """Turn what is along z so that it is along x."""
    return corners[:, [2, 0, 1]]
