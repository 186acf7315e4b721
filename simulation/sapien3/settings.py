"""How physics settings reach SAPIEN's process-wide configuration."""

from __future__ import annotations

from typing import Any

import sapien.physx as physx

from simulation.physics import PhysicsSettings


def apply(settings: PhysicsSettings) -> None:
    """Write the settings into SAPIEN's process-wide configuration.

    They bind when a scene, a body or a shape is made, so this runs before every build: another
    world's build may have changed them since.
    """
    physx.set_shape_config(contact_offset=settings.contact_offset, rest_offset=settings.rest_offset)
    physx.set_body_config(
        solver_position_iterations=settings.position_iterations,
        solver_velocity_iterations=settings.velocity_iterations,
        sleep_threshold=settings.sleep_threshold,
    )
    gravity: Any = settings.gravity  # SAPIEN takes any sequence
    physx.set_scene_config(
        gravity=gravity,
        bounce_threshold=settings.bounce_threshold,
        enable_pcm=settings.persistent_contacts,
        enable_tgs=settings.temporal_gauss_seidel,
        enable_ccd=settings.continuous_collision,
        enable_enhanced_determinism=settings.enhanced_determinism,
        enable_friction_every_iteration=settings.friction_every_iteration,
        cpu_workers=0,  # more workers are slower for scenes this small
    )
    friction = settings.friction
    physx.set_default_material(friction.static, friction.dynamic, friction.restitution)
