"""Changes worlds in place, as far as SAPIEN can.

Every value is set from the one that was built, so it does not depend on what was set before.
SAPIEN 3.0.3 has no way to change a shape's size once it is attached, nor the gravity of a system
that exists: for these, worlds are built anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import sapien
import sapien.physx as physx

from robot_layouts.simulation.scene.parts import Part
from robot_layouts.simulation.scene.variation import Variation

if TYPE_CHECKING:
    from robot_layouts.simulation.sapien3.world import BuiltWorld

_Value = TypeVar("_Value")


def vary(world: BuiltWorld, variation: Variation) -> None:
    """Let a world differ from what was built.

    Robots move when they are placed next, and pictures differ from the next one on.
    """
    if variation.looks is not None:
        world.looks = variation.looks
    for part, weightless in variation.weightless.items():
        _component(world, part).disable_gravity = weightless
    for part, factor in variation.mass.items():
        component = _component(world, part)
        mass, inertia = _as_built(world, part, "mass", lambda c=component: (c.mass, c.inertia))
        component.set_mass(mass * factor)
        component.set_inertia(inertia * factor)
    for part, coefficient in variation.friction.items():
        for material in _as_built(world, part, "friction", lambda p=part: _materials(world, p)):
            material.set_static_friction(coefficient)
            material.set_dynamic_friction(coefficient)
    for part in dict.fromkeys([*variation.stiffness, *variation.damping]):
        stiffness = variation.stiffness.get(part, 1.0)
        _set_drive(world, part, stiffness, variation.damping.get(part, 1.0))
    for part, coefficient in variation.joint_friction.items():
        _joint(world, part).set_friction(coefficient)
    for name, (position, quaternion) in variation.bases.items():
        world.robots[name].base_pose = sapien.Pose(list(position), list(quaternion))


def _set_drive(world: BuiltWorld, part: Part, stiffness: float, damping: float) -> None:
    joint = _joint(world, part)
    built = _as_built(world, part, "drive", lambda: (joint.stiffness, joint.damping))
    joint.set_drive_properties(
        built[0] * stiffness, built[1] * damping, joint.force_limit, joint.drive_mode
    )


def _materials(world: BuiltWorld, part: Part) -> list[Any]:
    """Give each shape of a part a material of its own, which others do not share, and return it."""
    materials: list[Any] = []
    for shape in _component(world, part).collision_shapes:
        shared = shape.physical_material
        friction = shared.static_friction, shared.dynamic_friction
        materials.append(physx.PhysxMaterial(*friction, shared.restitution))
        shape.set_physical_material(materials[-1])
    return materials


def _component(world: BuiltWorld, part: Part) -> Any:
    if part.robot is None:
        return world.bodies[part.name].component
    return world.robots[part.robot].link(part.name)


def _joint(world: BuiltWorld, part: Part) -> Any:
    assert part.robot is not None
    robot = world.robots[part.robot]
    return robot.driven[robot.descriptor.joints.index(part.name)]


def _as_built(world: BuiltWorld, part: Part, what: str, read: Callable[[], _Value]) -> _Value:
    """Return what a part was built with: what it has when it is asked for the first time."""
    if (part, what) not in world.built:
        world.built[part, what] = read()
    return world.built[part, what]
