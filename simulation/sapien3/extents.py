"""How much room things take up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sapien.physx as physx

from simulation.maths import Floats
from simulation.parts import Part
from simulation.sapien3.world import BuiltWorld

_PLANE = physx.PhysxCollisionShapePlane


def extents_of(world: BuiltWorld) -> dict[Part, Floats]:
    """Return the box around each link and body that collides; see `simulation.backend.Backend`."""
    return {
        part: component.get_global_aabb_fast()
        for part, component in _components(world)
        if any(
            not isinstance(s, physx.PhysxCollisionShapePlane) for s in component.collision_shapes
        )
    }


def _components(world: BuiltWorld) -> Iterator[tuple[Part, Any]]:
    for robot in world.robots.values():
        for link in robot.links.values():
            yield Part(robot.name, link.name), link
    for body in world.bodies.values():
        yield Part(None, body.declared.name), body.component
