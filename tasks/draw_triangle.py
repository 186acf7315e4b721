"""DrawTriangle: draw along the outline of a triangle with a stick."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from layouts import Layout, Placement
from robots import RobotRegistry, SimulationError
from robots.descriptor import Quaternion
from simulation import Box, Camera, Cylinder, PhysicsSettings, State, World, add_table
from simulation.arrays import Array, Floats
from simulation.shapes import Color
from tasks.props import WHITE
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/drawing/draw_triangle.py (m, rad)
MAX_DOTS = 300
DOT_RADIUS = 0.01
DOT_THICKNESS = 0.003
CANVAS_HALF_SIZE = (0.4, 0.6, 0.02 / 2)
CANVAS_X = -0.1
CANVAS_TOP = 0.02
REACH = CANVAS_TOP + DOT_THICKNESS + 0.005  # a stick below this height draws
THRESHOLD = 0.025  # between a dot and a point of the outline
SIDE = 0.3
BAR_HALF_SIZE = (SIDE / 2, 0.01 / 2, 0.001 / 2)
BAR_HEIGHT = 0.01
POINTS_PER_SIDE = 51  # of the outline, a corner and what follows it
SPAWN_SIZE, SPAWN_OFFSET = 0.02, -0.1
BRUSH: Color = (0.8, 0.2, 0.2, 1.0)
INK: Color = (10 / 255, 10 / 255, 10 / 255, 1.0)

_FLAT: Quaternion = (math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0)  # axis upright
_DOTS = [f"dot_{i}" for i in range(MAX_DOTS)]
_HIDDEN = (0.0, 0.0, -DOT_THICKNESS)  # inside the table
_REACH = torch.tensor(REACH)


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
        for (x, y, z), yaw in zip(_bar_centres(), (0.0, -math.pi / 3, math.pi / 3), strict=True)
    ]


def _bar_centres() -> np.ndarray[Any, np.dtype[np.float64]]:
    """Middles of the sides in the triangle's frame, (3, 3) (m)."""
    radius = (SIDE / 2) / math.sqrt(3)
    angles = (math.pi / 2 + turn for turn in (0.0, 2 * math.pi / 3, 4 * math.pi / 3))
    return np.array([(radius * math.cos(a), radius * math.sin(a), BAR_HEIGHT) for a in angles])


def _corners() -> Tensor:
    """Corners in the triangle's frame, as columns (3, 3), float64 as in native (m)."""
    a, b, c = _bar_centres()
    return torch.from_numpy(np.array([(a + c) - b, (a + b) - c, (b + c) - a])).T


def _placed_corners(pose: Floats) -> Tensor:
    """Corners of a triangle at ``pose`` (7,), (3, 3) float64 (m, world).

    The rotation is a float32 matrix and multiplies float64 corners, as in native.
    """
    position, quaternion = torch.from_numpy(pose).split((3, 4))
    w, x, y, z = quaternion.unbind()
    scale = 2.0 / (quaternion * quaternion).sum()
    rows = (
        (1 - scale * (y * y + z * z), scale * (x * y - z * w), scale * (x * z + y * w)),
        (scale * (x * y + z * w), 1 - scale * (x * x + z * z), scale * (y * z - x * w)),
        (scale * (x * z - y * w), scale * (y * z + x * w), 1 - scale * (x * x + y * y)),
    )
    matrix = torch.stack([torch.stack(row) for row in rows])
    return (matrix.double()[None] @ _CORNERS[None])[0].T + position


def _points_between(corners: Tensor) -> Tensor:
    """Points along the sides of a triangle, corners (3, 3) in order, (153, 2) float64 (m)."""
    share = torch.linspace(0, 1, POINTS_PER_SIDE + 1)[:-1, None]
    starts = corners[:, None, :2]
    ends = corners.roll(-1, 0)[:, None, :2]
    return (starts * (1 - share) + ends * share).reshape(-1, 2)


_CORNERS = _corners()


@register_task("DrawTriangle-v1", "maniskill.draw_triangle_native")
class DrawTriangle(MultiRobotTask):
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

    def begin_episodes(self, state: State, env_ids: Sequence[int]) -> None:
        """Forget what was drawn and remember where the outline is.

        As in native, none of this is part of the state dict, though the dots themselves are.
        """
        if len(env_ids) == self.num_envs:
            self._corners = torch.empty(self.num_envs, 3, 3, dtype=torch.float64)
            self._outline = torch.empty(self.num_envs, 3 * POINTS_PER_SIDE, 2, dtype=torch.float64)
            self._covered = torch.empty(self.num_envs, 3 * POINTS_PER_SIDE, dtype=torch.bool)
            self._strayed = torch.empty(self.num_envs, dtype=torch.bool)
            self._used = [0] * self.num_envs  # dots
        poses = state.pose("goal_tri")
        for i in env_ids:
            self._corners[i] = _placed_corners(poses[i])
            self._outline[i] = _points_between(self._corners[i])
            self._covered[i] = self._strayed[i] = False
            self._used[i] = 0

    def step(
        self, action: Any, env_ids: Sequence[int] | None = None
    ) -> tuple[Any, Tensor, Tensor, Tensor, Info]:
        """Advance by one control step; see `MultiRobotTask.step`.

        Raises:
            SimulationError: If an environment has used all its dots up; nothing moves then.
        """
        moving = range(self.num_envs) if env_ids is None else env_ids
        empty = [i for i in moving if self._used[i] >= MAX_DOTS]
        if empty:
            raise SimulationError(
                f"environments {empty} have used up their {MAX_DOTS} dots, one per step;"
                f" reset them: reset(env_ids={empty})"
            )
        return super().step(action, env_ids)

    def respond(self, state: State) -> None:
        """Leave a dot under every stick that is low enough, and hide a dot for every other."""
        tips = torch.from_numpy(state.tcp_position("arm"))
        drawing = torch.zeros(self.num_envs, dtype=torch.bool)
        for i in self.moving:
            drawing[i] = draws = bool(tips[i, 2] < _REACH)
            dot = _DOTS[self._used[i]]
            self._used[i] += 1
            place = (*tips[i, :2].tolist(), DOT_THICKNESS / 2 + CANVAS_TOP) if draws else _HIDDEN
            self.simulation.worlds[i].set_pose(dot, place, _FLAT)
        if drawing.any():
            ways = tips[:, None, :2] - self._outline
            near = ways.square().sum(2).sqrt() < THRESHOLD
            self._covered |= near & drawing[:, None]
            self._strayed |= ~near.any(1) & drawing

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all of the outline is covered, and nothing else."""
        return {"success": (self._covered.all(1) & ~self._strayed).numpy()}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, triangle, and its corners: from the TCP and in the world (float64)."""
        corners = self._corners.numpy()
        ways = corners - state.tcp_position("arm")[:, None]
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pose": state.pose("goal_tri"),
            "tcp_to_verts_pos": ways.reshape(self.num_envs, -1),
            "goal_pos": state.position("goal_tri"),
            "vertices": corners.reshape(self.num_envs, -1),
        }
