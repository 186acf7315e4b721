"""TableTopFreeDraw: draw what you like with a stick; nothing counts as success."""

from __future__ import annotations

import math

from robots import SimulationError
from tasks import (
    WHITE,
    Box,
    Cylinder,
    EpisodeRandom,
    Info,
    Quaternion,
    State,
    World,
    add_table,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maniskill.draw_triangle import (
    BRUSH,
    CANVAS_HALF_SIZE,
    CANVAS_X,
    DOT_HEIGHT,
    DOT_RADIUS,
    DOT_THICKNESS,
    REACH,
    DrawTriangle,
)
from tasks.maths import Array, concatenate, where

MAX_DOTS = 1010  # mani_skill 3.0.1, envs/tasks/drawing/draw.py

_FLAT: Quaternion = (math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0)  # axis upright
_HIDDEN = (0.0, 0.0, -DOT_THICKNESS)  # inside the table
_DOTS = [f"dot_{i}" for i in range(MAX_DOTS)]


@register_task("TableTopFreeDraw-v1", "maniskill.table_top_free_draw_native")
class TableTopFreeDraw(Clone):
    """Draw on a canvas, dot by dot, what you like.

    Every step leaves a dot under a stick that is low enough, and uses one of 1010 dots up even if
    it is not. Nothing is drawn by the seed. Success: none; an episode ends when its time is over.
    """

    source = "mani_skill 3.0.1, envs/tasks/drawing/draw.py"
    layout = DrawTriangle.layout
    physics = DrawTriangle.physics
    max_episode_steps = 1000
    open_ended = True
    viewpoint = DrawTriangle.viewpoint
    cameras = DrawTriangle.cameras

    def build(self, world: World) -> None:
        """Add the table, the canvas and the dots."""
        add_table(world)
        canvas = Box(half_size=CANVAS_HALF_SIZE, color=WHITE)
        place = (CANVAS_X, 0.0, CANVAS_HALF_SIZE[2])
        world.add("canvas", canvas, kind="static", position=place)
        dot = Cylinder(
            radius=DOT_RADIUS,
            half_length=DOT_THICKNESS / 2,
            color=BRUSH,
            collides=False,
        )
        for name in _DOTS:
            world.add(name, dot, kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Hide the dots."""
        world.set_poses(_DOTS, _HIDDEN, _FLAT)

    def remember(self, state: State) -> dict[str, Array]:
        """How many dots are used; not part of the state dict, though the dots themselves are."""
        return {"dots_used": state.full(0)}

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

    def evaluate(self, state: State) -> dict[str, Array]:
        """Nothing: all drawings are as good."""
        return {}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP."""
        return {"tcp_pose": state.tcp_pose("arm")}
