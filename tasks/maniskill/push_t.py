"""PushT: push a T-shaped block onto its outline with a stick."""

from __future__ import annotations

import math
from math import pi

from layouts import single
from tasks import (
    Box,
    Color,
    Compound,
    Cylinder,
    EpisodeRandom,
    Friction,
    Info,
    PhysicsSettings,
    State,
    Table,
    World,
    closeness,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, cos, rounded, sqrt, where
from tasks.native.drawing import CENTRE_OF_MASS_Y, cover, yaw

# mani_skill 3.0.1, envs/tasks/tabletop/push_t.py (m, rad)
BAR_HALF_SIZE = (0.1, 0.025)
STEM_HALF_SIZE = (0.025, 0.075)
HALF_THICKNESS = 0.02
TEE_FRICTION = Friction(3.0, 3.0, 0.0)
GOAL_XY = (-0.156, -0.1)
GOAL_YAW = (5 / 3) * pi
END_MARKER = (-0.321, 0.284, 1e-3)
ABOVE = (0.0, 0.0, 0.1)  # where everything is built
RED: Color = (194 / 255, 19 / 255, 22 / 255, 1.0)
GREY: Color = (128 / 255, 128 / 255, 128 / 255, 1.0)
SPAWN_SIZE = (0.2, 0.3)
SPAWN_OFFSET = -0.1
COVERED = 0.90  # share of the outline that must be covered
# Two equal shapes of radius r whose centroids are d apart share at most 1 - d / (2r + d) of their
# area, so a T (r = 0.152 m) that covers 90 % is nearer than 0.034 m. Counting in pixels of 4.7 mm
# moves each centroid and each match by at most a pixel's half diagonal, 3.3 mm: 0.044 m.
FARTHEST_COVERED = 0.045


def tee(thickness: float, color: Color, *, collides: bool) -> tuple[Box, ...]:
    """Return the two boxes of a T around its centre of mass, bar first.

    Args:
        thickness: Half its height (m).
        color: Red, green, blue, alpha.
        collides: Whether it is solid.
    """
    stem_y = 4 * BAR_HALF_SIZE[1] - CENTRE_OF_MASS_Y
    return tuple(
        Box(
            half_size=(*half_size, thickness),
            position=(0.0, y, 0.0),
            color=color,
            collides=collides,
            friction=TEE_FRICTION,
        )
        for half_size, y in ((BAR_HALF_SIZE, 0.0 - CENTRE_OF_MASS_Y), (STEM_HALF_SIZE, stem_y))
    )


@register_task("PushT-v1", "maniskill.push_t_native")
class PushT(Clone):
    """Push a T onto a fixed outline, from a random place and at a random angle.

    The T lies within 0.2 m × 0.3 m beside the outline. Success: it covers 90 % of the outline.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/push_t.py"
    layout = single({"arm": "panda_stick"}, keyframe="push_start")
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 3.0
    joint_noise_draws = 2
    viewpoint = ((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1))

    table = Table(textured=False)
    Tee = Compound(tee(HALF_THICKNESS, RED, collides=True), start=ABOVE)
    goal_Tee = Compound(tee(1e-4, GREY, collides=False), start=ABOVE, kind="kinematic")
    goal_ee = Compound(
        (Cylinder(radius=0.02, half_length=1e-4, color=GREY, collides=False),),
        start=ABOVE,
        kind="kinematic",
    )

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the T down beside its outline."""
        turn = (math.cos(GOAL_YAW / 2), 0.0, 0.0, math.sin(GOAL_YAW / 2))
        world.set_pose("goal_Tee", (*GOAL_XY, 1e-3), turn)
        offsets = [rng.uniform(1) * size + SPAWN_OFFSET for size in SPAWN_SIZE]
        x, y = (
            rounded(start) + offset.item() for start, offset in zip(GOAL_XY, offsets, strict=True)
        )
        half_angle = rng.uniform(1) * (2 * pi) / 2
        turn = (half_angle.cos().item(), 0.0, 0.0, half_angle.sin().item())
        world.set_pose("Tee", (x, y, HALF_THICKNESS + 1e-3), turn)
        world.set_pose("goal_ee", END_MARKER, (math.cos(pi / 4), 0.0, math.sin(pi / 4), 0.0))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the T covers its outline."""
        success = state.planar_distance("goal_Tee", "Tee") < FARTHEST_COVERED
        if success.any():
            shares = cover(state.pose("Tee"), (*GOAL_XY, GOAL_YAW), success)
            success = success & (shares >= COVERED)
        return {"success": success}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, outline and T."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_Tee"),
            "obj_pose": state.pose("Tee"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Turn (1/2), place (1/2), keep the stick near (1/20); 3 on success."""
        turned = cos(yaw(state.quaternion("Tee")) - GOAL_YAW)
        placed, reach = closeness(
            state.planar_distance("goal_Tee", "Tee"), state.tcp_distance("arm", "Tee")
        )
        # ((turned + 1) / 2)² / 2: halving is exact, so it may be done at once.
        facing = turned + 1.0
        reward = facing * facing * (1 / 8) + placed * placed * (1 / 2) + sqrt(reach) / 20.0
        return where(info["success"], 3.0, reward)
