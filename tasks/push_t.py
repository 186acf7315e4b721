"""PushT: push a T-shaped block onto its outline with a stick."""

from __future__ import annotations

import math
from functools import lru_cache
from math import pi

import numpy as np
import torch
from numpy.typing import NDArray

from layouts import single
from simulation import Box, Cylinder, Friction, PhysicsSettings, State, World, add_table
from simulation.arrays import Array, Floats, arccos, constants, cos, sin, sqrt
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.shaping import closeness
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/tabletop/push_t.py (m, rad)
BAR_HALF_SIZE = (0.1, 0.025)
STEM_HALF_SIZE = (0.025, 0.075)
HALF_THICKNESS = 0.02
CENTRE_OF_MASS_Y = 0.0375  # of the T, above the bar's centre
TEE_FRICTION = Friction(3.0, 3.0, 0.0)
GOAL_XY = (-0.156, -0.1)
GOAL_YAW = (5 / 3) * pi
END_MARKER = (-0.321, 0.284, 1e-3)
SPAWN_SIZE = (0.2, 0.3)
SPAWN_OFFSET = -0.1
COVERED = float(np.float32(0.90))  # share of the outline that must be covered
RESOLUTION = 64  # pixels along each side of the picture in which cover is counted
PICTURE_HALF_WIDTH = 0.15
# Two equal shapes of radius r whose centroids are d apart share at most 1 - d / (2r + d) of their
# area, so a T (r = 0.152 m) that covers 90 % is nearer than 0.034 m. Counting in pixels of 4.7 mm
# moves each centroid and each match by at most a pixel's half diagonal, 3.3 mm: 0.044 m.
FARTHEST_COVERED = 0.045


def tee(*, thickness: float, color: tuple[float, float, float, float], collides: bool) -> list[Box]:
    """Return the two boxes of a T around its centre of mass, bar first.

    Args:
        thickness: Half its height (m).
        color: Red, green, blue, alpha.
        collides: Whether it is solid.
    """
    stem_y = 4 * BAR_HALF_SIZE[1] - CENTRE_OF_MASS_Y
    return [
        Box(
            half_size=(*half_size, thickness),
            position=(0.0, y, 0.0),
            color=color,
            collides=collides,
            friction=TEE_FRICTION,
        )
        for half_size, y in ((BAR_HALF_SIZE, 0.0 - CENTRE_OF_MASS_Y), (STEM_HALF_SIZE, stem_y))
    ]


@register_task("PushT-v1", "maniskill.push_t_native")
class PushT(MultiRobotTask):
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

    def build(self, world: World) -> None:
        """Add the table, the T, its outline and the marker where the stick starts."""
        add_table(world, textured=False)
        red, grey = (194 / 255, 19 / 255, 22 / 255, 1.0), (128 / 255, 128 / 255, 128 / 255, 1.0)
        above = (0.0, 0.0, 0.1)
        world.add("Tee", *tee(thickness=HALF_THICKNESS, color=red, collides=True), position=above)
        outline = tee(thickness=1e-4, color=grey, collides=False)
        world.add("goal_Tee", *outline, kind="kinematic", position=above)
        marker = Cylinder(radius=0.02, half_length=1e-4, color=grey, collides=False)
        world.add("goal_ee", marker, kind="kinematic", position=above)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the T down beside its outline."""
        yaw = (math.cos(GOAL_YAW / 2), 0.0, 0.0, math.sin(GOAL_YAW / 2))
        world.set_pose("goal_Tee", (*GOAL_XY, 1e-3), yaw)
        offsets = [rng.uniform(1) * size + SPAWN_OFFSET for size in SPAWN_SIZE]
        x, y = (
            start + offset.item() for start, offset in zip((_GOAL_X, _GOAL_Y), offsets, strict=True)
        )
        half_angle = rng.uniform(1) * (2 * pi) / 2
        turn = (half_angle.cos().item(), 0.0, 0.0, half_angle.sin().item())
        world.set_pose("Tee", (x, y, HALF_THICKNESS + 1e-3), turn)
        world.set_pose("goal_ee", END_MARKER, (math.cos(pi / 4), 0.0, math.sin(pi / 4), 0.0))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the T covers its outline."""
        success = np.zeros(self.num_envs, bool)
        for i, distance in enumerate(state.planar_distance("goal_Tee", "Tee").tolist()):
            if distance < FARTHEST_COVERED:
                success[i] = _cover(state.pose("Tee")[i].tobytes()) >= COVERED
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
        turned = cos(_yaw(state.quaternion("Tee")) - _GOAL_YAW)
        placed, reach = closeness(
            state.planar_distance("goal_Tee", "Tee"), state.tcp_distance("arm", "Tee")
        )
        # ((turned + 1) / 2)² / 2: halving is exact, so it may be done at once.
        facing = turned + _ONE
        reward = facing * facing * _EIGHTH + placed * placed * _HALF + sqrt(reach) / _TWENTY
        return np.where(info["success"], _DONE, reward)


def _yaw(quaternion: Floats) -> Floats:
    """Angle about z in [0, 2π] of wxyz quaternions (N, 4) that turn about z only, (N,) (rad)."""
    w, z = quaternion[:, ::3].T
    return _TWO * arccos(np.where(z < 0, -w, w))


def _planar_transform(yaw: Floats, x: float, y: float) -> torch.Tensor:
    """Homogeneous 3 × 3 matrix of a rotation about z (rad, one number) and a shift (m)."""
    cosine, sine = cos(yaw).item(), sin(yaw).item()
    return torch.tensor([[cosine, -sine, x], [sine, cosine, y], [0.0, 0.0, 1.0]])


def _outline() -> NDArray[np.bool_]:
    """The T as pixels (x, y) of its own frame, (64, 64)."""
    half, scale = RESOLUTION / 2, RESOLUTION / 2 / PICTURE_HALF_WIDTH
    picture = np.zeros((RESOLUTION, RESOLUTION), bool)
    corners = torch.tensor([[[-0.1, -0.025], [0.1, 0.025]], [[-0.025, 0.025], [0.025, 0.175]]])
    corners[..., 1] -= CENTRE_OF_MASS_Y
    for (left, bottom), (right, top) in (corners * scale + half).long().tolist():
        picture[left:right, bottom:top] = True
    return picture


def _pixel_centres() -> torch.Tensor:
    """Homogeneous coordinates of the centres of all pixels, (3, 4096) (m), from the top row on."""
    line = torch.arange(RESOLUTION, dtype=torch.float32) - RESOLUTION / 2
    x = line.expand(RESOLUTION, RESOLUTION)
    metres = (torch.stack([x, -x.T]) + 0.5) / ((RESOLUTION / 2) / PICTURE_HALF_WIDTH)
    return torch.cat([metres, torch.ones(1, RESOLUTION, RESOLUTION)]).view(3, -1)


_EIGHTH, _HALF, _ONE, _TWO, _TWENTY, _DONE = constants(1 / 8, 1 / 2, 1.0, 2.0, 20.0, 3.0)
_GOAL_YAW = np.array([GOAL_YAW], np.float32)
_GOAL_X, _GOAL_Y = torch.tensor(GOAL_XY).tolist()  # as float32 rounds them
_OUTLINE = _outline()
_TEE_PIXELS = np.flatnonzero(_OUTLINE.T[::-1])  # in the order of the pixel centres
_CENTRES = _pixel_centres()
_WORLD_TO_GOAL = torch.linalg.inv(
    _planar_transform(_TWO * arccos(cos(_GOAL_YAW / _TWO)), _GOAL_X, _GOAL_Y)
)


@lru_cache(maxsize=1024)  # the T lies still most of the time
def _cover(pose: bytes) -> float:
    """Share of the outline that a T at ``pose`` covers, counted in pixels, as native does.

    The T's own pixels are drawn into the outline's frame; what falls outside the picture is drawn
    into its corner.

    Args:
        pose: Position (m) and quaternion (wxyz), seven float32.
    """
    x, y, _, *quaternion = np.frombuffer(pose, np.float32).tolist()
    tee_to_world = _planar_transform(_yaw(np.array([quaternion], np.float32)), x, y)
    tee_to_goal = (_WORLD_TO_GOAL @ tee_to_world[None])[0]
    centres = (tee_to_goal @ _CENTRES).numpy().take(_TEE_PIXELS, 1)[:2]
    scale = np.float32(RESOLUTION / 2 / PICTURE_HALF_WIDTH)
    pixels = (centres * scale + np.float32(RESOLUTION / 2)).astype(np.int64)
    inside = ((pixels >= 0) & (pixels < RESOLUTION)).all(0)
    drawn = np.zeros((RESOLUTION, RESOLUTION), bool)
    drawn[tuple(pixels * inside)] = True
    return float(np.float32((drawn & _OUTLINE).sum()) / np.float32(_OUTLINE.sum()))
