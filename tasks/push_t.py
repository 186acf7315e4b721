"""PushT: push a T-shaped block onto its outline with a stick."""

from __future__ import annotations

from math import cos, pi, sin

import torch
from torch import Tensor

from layouts import single
from simulation import Box, Cylinder, Friction, PhysicsSettings, State, World, add_table
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
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
COVERED = 0.90  # share of the outline that must be covered
RESOLUTION = 64  # pixels along each side of the picture in which cover is counted
PICTURE_HALF_WIDTH = 0.15
# Two equal shapes of radius r whose centroids are d apart share at most 1 - d / (2r + d) of their
# area: a T (r = 0.152 m) that covers 90 % is nearer than 0.034 m. The rest is for rounding.
FARTHEST_COVERED = 0.06


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

    layout = single({"arm": "panda_stick"}, keyframe="push_start")
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 3.0
    viewpoint = ((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1))

    def build(self, world: World) -> None:
        """Add the table, the T, its outline and the marker where the stick starts."""
        add_table(world)
        red, grey = (194 / 255, 19 / 255, 22 / 255, 1.0), (128 / 255, 128 / 255, 128 / 255, 1.0)
        above = (0.0, 0.0, 0.1)
        world.add("Tee", *tee(thickness=HALF_THICKNESS, color=red, collides=True), position=above)
        outline = tee(thickness=1e-4, color=grey, collides=False)
        world.add("goal_Tee", *outline, kind="kinematic", position=above)
        marker = Cylinder(radius=0.02, half_length=1e-4, color=grey, collides=False)
        world.add("goal_ee", marker, kind="kinematic", position=above)

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the arm over the marker; native draws its noise twice and uses the second."""
        for placement in world.layout.values():
            rng.normal(placement.qpos_noise, placement.robot.dof)
        super().reset_robots(world, rng)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the T down beside its outline."""
        yaw = (cos(GOAL_YAW / 2), 0.0, 0.0, sin(GOAL_YAW / 2))
        world.set_pose("goal_Tee", (*GOAL_XY, 1e-3), yaw)
        offsets = [rng.uniform(1) * size + SPAWN_OFFSET for size in SPAWN_SIZE]
        x, y = (start + offset.item() for start, offset in zip(_GOAL_XY, offsets, strict=True))
        half_angle = rng.uniform(1) * (2 * pi) / 2
        turn = (half_angle.cos().item(), 0.0, 0.0, half_angle.sin().item())
        world.set_pose("Tee", (x, y, HALF_THICKNESS + 1e-3), turn)
        world.set_pose("goal_ee", END_MARKER, (cos(pi / 4), 0.0, sin(pi / 4), 0.0))

    def evaluate(self, state: State) -> dict[str, Tensor]:
        """Success: the T covers its outline."""
        success = torch.zeros(self.num_envs, dtype=torch.bool)
        near = state.planar_distance("goal_Tee", "Tee") < FARTHEST_COVERED
        if near.any():
            for i in near.nonzero()[:, 0].tolist():
                success[i] = _cover(state.pose("Tee")[i]) >= COVERED
        return {"success": success}

    def observe(self, state: State, info: Info) -> dict[str, Tensor]:
        """TCP, outline and T."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_Tee"),
            "obj_pose": state.pose("Tee"),
        }

    def dense_reward(self, state: State, action: Tensor, info: Info) -> Tensor:
        """Turn (1/2), place (1/2), keep the stick near (1/20); 3 on success."""
        turned = (_yaw(state.quaternion("Tee")) - GOAL_YAW).cos()
        reward = (((turned + 1) / 2) ** 2) / 2
        away = state.planar_distance("goal_Tee", "Tee")
        reward = reward + ((1 - torch.tanh(5 * away)) ** 2) / 2
        reach = 1 - torch.tanh(5 * state.tcp_distance("arm", "Tee"))
        reward = reward + reach.sqrt() / 20
        return torch.where(info["success"], 3.0, reward)


_GOAL_XY = torch.tensor(GOAL_XY).tolist()  # as float32 rounds them


def _yaw(quaternion: Tensor) -> Tensor:
    """Angle about z in [0, 2π] of wxyz quaternions (N, 4) that turn about z only, (N,) (rad)."""
    w, z = quaternion[:, 0], quaternion[:, 3]
    return 2 * torch.where(z < 0, -w, w).acos()


def _planar_transform(yaw: Tensor, xy: Tensor) -> Tensor:
    """Homogeneous 3 × 3 matrix of a rotation about z (rad) and a shift in the plane (m)."""
    matrix = torch.eye(3)
    matrix[0, 0] = matrix[1, 1] = yaw.cos()
    matrix[0, 1], matrix[1, 0] = -yaw.sin(), yaw.sin()
    matrix[:2, 2] = xy
    return matrix


def _to_pixels(metres: Tensor) -> Tensor:
    return (metres * ((RESOLUTION / 2) / PICTURE_HALF_WIDTH) + RESOLUTION / 2).long()


def _outline() -> Tensor:
    """The outline as pixels of its own frame, (64, 64) bool, rows from +y down, columns along +x."""
    corners = torch.tensor(
        [
            [[-0.1, 0.025], [0.1, -0.025]],  # bar: upper left, lower right
            [[-0.025, 0.175], [0.025, 0.025]],  # stem
        ]
    )
    corners[..., 1] -= CENTRE_OF_MASS_Y
    corners *= (RESOLUTION / 2) / PICTURE_HALF_WIDTH
    corners += RESOLUTION / 2
    picture = torch.zeros(RESOLUTION, RESOLUTION, dtype=torch.bool)
    for (left, top), (right, bottom) in corners.long().tolist():
        picture[bottom:top, left:right] = True
    return picture.flip(0)


def _pixel_centres() -> Tensor:
    """Homogeneous coordinates of every pixel's centre, (3, 4096) (m), row by row."""
    line = torch.arange(RESOLUTION, dtype=torch.float32) - RESOLUTION / 2
    x = line.expand(RESOLUTION, RESOLUTION)
    metres = (torch.stack([x, -1 * x.T]) + 0.5) / ((RESOLUTION / 2) / PICTURE_HALF_WIDTH)
    return torch.cat([metres, torch.ones(1, RESOLUTION, RESOLUTION)]).view(3, -1)


_OUTLINE = _outline()
_OUTLINE_BY_XY = _OUTLINE.flip(0).T.reshape(-1)  # pixel (x, y) at x * 64 + y, y upwards
_CENTRES = _pixel_centres()
_TEE_PIXELS = _OUTLINE.reshape(-1).nonzero()[:, 0]
_WORLD_TO_GOAL = torch.linalg.inv(
    _planar_transform(
        2 * (torch.tensor(GOAL_YAW) / 2).cos().acos(), torch.tensor(GOAL_XY)
    )
)


def _cover(pose: Tensor) -> Tensor:
    """Share of the outline that a T at ``pose`` (7,) covers, counted in pixels, as native does."""
    tee_to_world = _planar_transform(_yaw(pose[None, 3:])[0], pose[:2])
    tee_to_goal = (_WORLD_TO_GOAL @ tee_to_world[None])[0]
    centres = (tee_to_goal @ _CENTRES)[:, _TEE_PIXELS]
    pixels = _to_pixels(centres[:2] / centres[2])
    outside = ((pixels < 0) | (pixels >= RESOLUTION)).any(0)
    pixels[:, outside] = 0  # native draws what falls outside into the corner
    drawn = torch.zeros(RESOLUTION * RESOLUTION, dtype=torch.bool)
    drawn[pixels[0] * RESOLUTION + pixels[1]] = True
    return (drawn & _OUTLINE_BY_XY).sum().float() / _OUTLINE.sum().float()
