"""Physics settings of a world, and how they reach SAPIEN's process-wide configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sapien.physx as physx

from robots.descriptor import Vector3


@dataclass(frozen=True)
class Friction:
    """A contact material.

    Attributes:
        static: Static friction coefficient.
        dynamic: Dynamic friction coefficient.
        restitution: Coefficient of restitution, 0 … 1.
    """

    static: float = 0.3
    dynamic: float = 0.3
    restitution: float = 0.0


@dataclass(frozen=True)
class PhysicsSettings:
    """How PhysX solves a world. The defaults are ManiSkill's.

    Source: mani_skill 3.0.1, utils/structs/types.py (SceneConfig, DefaultMaterialsConfig).

    Attributes:
        timestep: Length of one physics step (s).
        gravity: Acceleration in the world frame (m/s²).
        contact_offset: Distance at which contacts are generated (m).
        rest_offset: Distance at which bodies come to rest (m).
        position_iterations: Solver position iterations.
        velocity_iterations: Solver velocity iterations.
        sleep_threshold: Mass-normalised kinetic energy below which bodies sleep (J/kg).
        bounce_threshold: Relative speed below which contacts do not bounce (m/s).
        persistent_contacts: PhysX's persistent contact manifold.
        temporal_gauss_seidel: PhysX's TGS solver instead of PGS.
        continuous_collision: Continuous collision detection.
        enhanced_determinism: Results independent of other bodies in the scene.
        friction_every_iteration: Friction in every solver iteration.
        friction: Material of shapes that name none.
    """

    timestep: float = 1 / 100
    gravity: Vector3 = (0.0, 0.0, -9.81)
    contact_offset: float = 0.02
    rest_offset: float = 0.0
    position_iterations: int = 15
    velocity_iterations: int = 1
    sleep_threshold: float = 0.005
    bounce_threshold: float = 2.0
    persistent_contacts: bool = True
    temporal_gauss_seidel: bool = True
    continuous_collision: bool = False
    enhanced_determinism: bool = False
    friction_every_iteration: bool = True
    friction: Friction = Friction()


# What SAPIEN 3.0.3 uses when nobody configures it (read from a fresh process).
SAPIEN_DEFAULTS = PhysicsSettings(
    contact_offset=0.01, position_iterations=10, friction=Friction(0.3, 0.3, 0.1)
)


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
