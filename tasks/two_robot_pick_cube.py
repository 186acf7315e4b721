"""TwoRobotPickCube: the left arm brings a cube to the right arm, which holds it at a goal."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from layouts import face_to_face
from simulation import Box, PhysicsSettings, Sphere, State, World, add_table
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/tabletop/two_robot_pick_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.025
STATIC_SPEED = 0.2  # rad/s
OPEN_FINGER_GAP = 0.07
LEFT_ARM_RETREAT = -0.2  # y the left TCP should retreat to


@register_task("TwoRobotPickCube-v1", "maniskill.two_robot_pick_cube_native")
class TwoRobotPickCube(MultiRobotTask):
    """Hand a cube over: it starts out of the right arm's reach, the goal is out of the left's.

    The cube lies at y in [-0.2, -0.1], the goal at y in [0.1, 0.2], both with x in
    [-0.05, 0.05] (m). Success: the cube is within 2.5 cm of the goal and the right arm static.
    """

    layout = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.5)
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 21
    shared_joint_noise = True  # native gives both arms one draw
    viewpoint = ((1.4, 0.8, 0.75), (0.0, 0.1, 0.1))

    def build(self, world: World) -> None:
        """Add the table, the cube and the goal."""
        add_table(world)
        world.add(
            "cube",
            Box(half_size=(CUBE_HALF_SIZE,) * 3, color=(1, 0, 0, 1)),
            position=(0.0, 0.0, CUBE_HALF_SIZE),
        )
        world.add(
            "goal_site",
            Sphere(radius=GOAL_RADIUS, color=(0, 1, 0, 1), collides=False),
            kind="kinematic",
        )

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the left and the goal on the right."""
        x = rng.uniform(1) * 0.1 - 0.05
        y = -0.15 - rng.uniform(1) * 0.1 + 0.05
        world.set_pose("cube", (x.item(), y.item(), CUBE_HALF_SIZE), rng.yaw_quaternion())
        x = rng.uniform(1) * 0.1 - 0.05
        y = 0.15 + rng.uniform(1) * 0.1 - 0.05
        z = rng.uniform(1) * 0.3 + CUBE_HALF_SIZE
        world.set_pose("goal_site", (x.item(), y.item(), z.item()))

    def begin_episodes(self, state: State, env_ids: Sequence[int]) -> None:
        """Remember where the left arm started."""
        qpos = state.qpos("left")
        if len(env_ids) == self.num_envs:
            self._left_start = qpos.clone()
        else:
            self._left_start[list(env_ids)] = qpos[list(env_ids)]

    def evaluate(self, state: State) -> dict[str, Tensor]:
        """Success: placed, and the right arm static."""
        placed = state.distance("cube", "goal_site") <= GOAL_RADIUS
        static = state.is_static("right", STATIC_SPEED)
        return {
            "success": placed & static,
            "is_obj_placed": placed,
            "is_right_arm_static": static,
        }

    def observe(self, state: State, info: Info) -> dict[str, Tensor]:
        """Both TCPs, the cube, and the ways between them."""
        cube = state.position("cube")
        return {
            "left_arm_tcp": state.tcp_pose("left"),
            "right_arm_tcp": state.tcp_pose("right"),
            "cube_pose": state.pose("cube"),
            "left_arm_tcp_to_cube_pos": cube - state.tcp_position("left"),
            "right_arm_tcp_to_cube_pos": cube - state.tcp_position("right"),
            "cube_to_goal_pos": state.position("goal_site") - cube,
        }

    def dense_reward(self, state: State, action: Tensor, info: Info) -> Tensor:
        """Bring (2), take over (8), carry (12), place (19), hold still (21 on success)."""
        cube_y = state.position("cube")[:, 1]
        reach = _closeness(state.tcp_distance("left", "cube"))
        across = _closeness((0.05 - cube_y).clamp(min=0))
        reward = (reach + across) / 2

        is_grasped = state.is_grasping("right", "cube")
        take_over = (
            _closeness(state.tcp_distance("right", "cube"))
            + self._finger_readiness(state)
            + _closeness((state.tcp_position("left")[:, 1] - LEFT_ARM_RETREAT).abs())
            + 2 * is_grasped
        )
        reward = torch.where(cube_y >= 0.0, 2 + take_over, reward)

        to_goal = torch.linalg.vector_norm(
            state.position("goal_site") - state.tcp_position("right"), dim=1
        )
        left_strayed = torch.linalg.vector_norm(state.qpos("left") - self._left_start, dim=1)
        carry = 2 * _closeness(to_goal) + (1 - torch.tanh(left_strayed))
        reward = torch.where(is_grasped, 8 + carry, reward)
        reward = torch.where((to_goal < 0.25) & is_grasped, 12 + 2 * carry, reward)

        still = (self._stillness(state, "right") + self._stillness(state, "left")) / 2
        reward = torch.where(info["is_obj_placed"], 19 + still, reward)
        return torch.where(info["success"], 21.0, reward)

    @staticmethod
    def _stillness(state: State, robot: str) -> Tensor:
        return _closeness(torch.linalg.vector_norm(state.arm_qvel(robot), dim=1))

    @staticmethod
    def _finger_readiness(state: State) -> Tensor:
        """How level and open the right fingers are, (N,) in 0 … 1; 0 for a robot without any."""
        fingers = state.finger_positions("right")
        if fingers is None:
            return torch.zeros(state.num_envs)
        first, second = fingers
        gap = torch.linalg.vector_norm(first - second, dim=1)
        level = _closeness((first[:, 2] - second[:, 2]).abs())
        return (level + _closeness((gap - OPEN_FINGER_GAP).abs())) / 2


def _closeness(distance: Tensor) -> Tensor:
    """1 at distance 0, falling to 0 within about half a metre."""
    return 1 - torch.tanh(5 * distance)
