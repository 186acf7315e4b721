"""PickCube: grasp a cube and hold it at a goal."""

from __future__ import annotations

import torch
from torch import Tensor

from layouts import single
from simulation import PhysicsSettings, State, World, add_table
from tasks.props import add_cube, add_goal
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.shaping import closeness
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py and pick_cube_cfgs.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.025
SPAWN_HALF_SIZE = 0.1
MAX_GOAL_HEIGHT = 0.3
STATIC_SPEED = 0.2  # rad/s


@register_task("PickCube-v1", "maniskill.pick_cube_native")
class PickCube(MultiRobotTask):
    """Grasp a cube from the table and hold it still at a goal in the air.

    Cube and goal are drawn from a square of 0.2 m around the origin, the goal up to 0.3 m above
    the cube. Success: the cube is within 2.5 cm of the goal and the arm is static.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 5

    def build(self, world: World) -> None:
        """Add the table, the cube and the goal."""
        add_table(world)
        add_cube(world, "cube", CUBE_HALF_SIZE, position=(0.0, 0.0, CUBE_HALF_SIZE))
        add_goal(world, GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the table and the goal above it."""
        x, y = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0].tolist()
        world.set_pose("cube", (x, y, CUBE_HALF_SIZE), rng.yaw_quaternion())
        x, y = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0].tolist()
        z = rng.uniform(1) * MAX_GOAL_HEIGHT + CUBE_HALF_SIZE
        world.set_pose("goal_site", (x, y, z.item()))

    def evaluate(self, state: State) -> dict[str, Tensor]:
        """Success: placed and static."""
        placed = state.distance("cube", "goal_site") <= _GOAL_RADIUS
        static = state.is_static("arm", STATIC_SPEED)
        return {
            "success": placed & static,
            "is_obj_placed": placed,
            "is_robot_static": static,
            "is_grasped": state.is_grasping("arm", "cube"),
        }

    def observe(self, state: State, info: Info) -> dict[str, Tensor]:
        """Grasp, TCP, goal and cube."""
        return {
            "is_grasped": info["is_grasped"],
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_site"),
            "obj_pose": state.pose("cube"),
            "tcp_to_obj_pos": state.tcp_offset("arm", "cube"),
            "obj_to_goal_pos": state.offset("cube", "goal_site"),
        }

    def dense_reward(self, state: State, action: Tensor, info: Info) -> Tensor:
        """Reach (1), grasp (1), place (1), hold still (1); 5 on success."""
        reach, place, still = closeness(
            state.tcp_distance("arm", "cube"),
            state.distance("cube", "goal_site"),
            state.arm_speed("arm"),
        )
        grasped, placed = info["is_grasped"].float(), info["is_obj_placed"].float()
        reward = reach + grasped + place * grasped + still * placed
        return torch.where(info["success"], _DONE, reward)


_GOAL_RADIUS, _DONE = torch.tensor([GOAL_RADIUS, 5.0])  # m, reward
