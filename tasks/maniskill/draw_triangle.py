"""DrawTriangle: draw along the outline of a triangle with a stick."""

from __future__ import annotations

import math

from layouts import Layout, Placement
from robots import RobotRegistry, SimulationError
from tasks import (
    WHITE,
    Box,
    Camera,
    Color,
    Cylinder,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    Quaternion,
    State,
    World,
    add_table,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, concatenate, where, zeros
from tasks.native.drawing import near, placed_corners, points_along, side_middles

# mani_skill 3.0.1, envs/tasks/drawing/draw_triangle.py (m, rad)
MAX_DOTS = 300
DOT_RADIUS = 0.01
DOT_THICKNESS = 0.003
CANVAS_HALF_SIZE = (0.4, 0.6, 0.02 / 2)
CANVAS_X = -0.1
CANVAS_TOP = 0.02
DOT_HEIGHT = DOT_THICKNESS / 2 + CANVAS_TOP
REACH = CANVAS_TOP + DOT_THICKNESS + 0.005  # a stick below this height draws
THRESHOLD = 0.025  # between a dot and a point of the outline
SIDE = 0.3
BAR_HALF_SIZE = (SIDE / 2, 0.01 / 2, 0.001 / 2)
BAR_HEIGHT = 0.01
SPAWN_SIZE, SPAWN_OFFSET = 0.02, -0.1
BRUSH: Color = (0.8, 0.2, 0.2, 1.0)
INK: Color = (10 / 255, 10 / 255, 10 / 255, 1.0)

_FLAT: Quaternion = (math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0)  # axis upright
_DOTS = [f"dot_{i}" for i in range(MAX_DOTS)]
_HIDDEN = (0.0, 0.0, -DOT_THICKNESS)  # inside the table


def bars() -> list[Box]:
    """Return the three sides of the triangle around its middle."""
    return [
        Box(
            half_size=BAR_HALF_SIZE,
            position=(x, y, z),
            quaternion=(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)),
            color=INK,
            collides=False,
        )
        for (x, y, z), yaw in zip(
            side_middles(SIDE, BAR_HEIGHT), (0.0, -math.pi / 3, math.pi / 3), strict=True
        )
    ]


@register_task("DrawTriangle-v1", "maniskill.draw_triangle_native")
class DrawTriangle(Clone):
    """Draw over the outline of a triangle on a canvas, dot by dot, without straying from it.

    The triangle lies within 2 cm, turned by any angle. Every step leaves a dot under a stick that
    is low enough, and uses one of 300 dots up even if it is not. Success: every point of the
    outline is within 2.5 cm of a dot, and every dot within 2.5 cm of a point of the outline.
    """

    source = "mani_skill 3.0.1, envs/tasks/drawing/draw_triangle.py"
    layout = Layout({"arm": Placement(RobotRegistry.load("panda_stick"), qpos_noise=0.0)})
    physics = PhysicsSettings(contact_offset=0.01, position_iterations=4, velocity_iterations=0)
    max_episode_steps = MAX_DOTS
    reward_modes = ("sparse",)
    viewpoint = ((0.3, 0.0, 0.8), (0.0, 0.0, 0.1))
    cameras = (Camera((0.3, 0.0, 0.8), (0.0, 0.0, 0.1), width=320, height=240, fov=1.2),)

    def build(self, world: World) -> None:
        """Add the table, the canvas, the dots and the triangle."""
        add_table(world)
        canvas = Box(half_size=CANVAS_HALF_SIZE, color=WHITE)
        world.add("canvas", canvas, kind="static", position=(CANVAS_X, 0.0, CANVAS_HALF_SIZE[2]))
        dot = Cylinder(
            radius=DOT_RADIUS, half_length=DOT_THICKNESS / 2, color=BRUSH, collides=False
        )
        for name in _DOTS:
            world.add(name, dot, kind="kinematic", position=(0.0, 0.0, 0.1))
        world.add("goal_tri", *bars(), kind="kinematic", position=(0.0, 0.0, 0.1))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the triangle on the canvas and hide the dots."""
        x, y = (rng.uniform(1, 2) * SPAWN_SIZE + SPAWN_OFFSET)[0].tolist()
        world.set_pose("goal_tri", (x, y, BAR_HEIGHT), rng.yaw_quaternion())
        world.set_poses(_DOTS, _HIDDEN, _FLAT)

    def remember(self, state: State) -> dict[str, Array]:
        """Where the outline is, and what was drawn.

        As in native, none of this is part of the state dict, though the dots themselves are.
        """
        corners = placed_corners(state.pose("goal_tri"), SIDE, BAR_HEIGHT)
        outline = points_along(corners)
        return {
            "corners": corners,
            "outline": outline,
            "covered": zeros(outline[:, :, 0]) > 0.0,
            "strayed": state.full(False),
            "dots_used": state.full(0),
        }

    def begin_step(self) -> None:
        """Refuse to go on without dots.

        Raises:
            SimulationError: If an environment has used all its dots up; nothing moves then.
        """
        used = self.memory.dots_used.tolist()
        if empty := [i for i in self.moving if used[i] >= MAX_DOTS]:
            raise SimulationError(
                f"environments {empty} have used up their {MAX_DOTS} dots, one per step;"
                f" reset them: reset(env_ids={empty})"
            )

    def respond(self, state: State) -> None:
        """Leave a dot under every stick that is low enough, and hide a dot for every other."""
        tips, memory = state.tcp_position("arm"), self.memory
        moving = state.among(self.moving)
        drawing = moving & (tips[:, 2] < REACH)
        on_canvas = concatenate((tips[:, :2], state.full(DOT_HEIGHT)[:, None]), 1)
        place = where(drawing[:, None], on_canvas, state.array(_HIDDEN))
        dots = [_DOTS[used] if used < MAX_DOTS else "" for used in memory.dots_used.tolist()]
        self.simulation.place(dots, place, _FLAT, where=moving)
        memory.dots_used += moving
        if drawing.any():
            nearby = near(memory.outline, tips[:, :2], THRESHOLD)
            memory.covered |= nearby & drawing[:, None]
            memory.strayed |= ~nearby.any(1) & drawing

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all of the outline is covered, and nothing else."""
        return {"success": self.memory.covered.all(1) & ~self.memory.strayed}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, triangle, and its corners: from the TCP and in the world (float64)."""
        corners = self.memory.corners
        ways = corners - state.tcp_position("arm")[:, None]
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pose": state.pose("goal_tri"),
            "tcp_to_verts_pos": ways.reshape(self.num_envs, -1),
            "goal_pos": state.position("goal_tri"),
            "vertices": corners.reshape(self.num_envs, -1),
        }
