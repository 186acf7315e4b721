"""PushCube: push a cube onto a target in front of it."""

from __future__ import annotations

import numpy as np

from layouts import single
from simulation import PhysicsSettings, State, World, add_table
from simulation.arrays import Array, Floats, constants, norm
from tasks.props import DARK_BLUE, FACE_UP, TARGET_HEIGHT, add_cube, add_target
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.shaping import closeness
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/tabletop/push_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.1
GOAL_OFFSET = 0.1 + GOAL_RADIUS  # of the target from the cube, along x
SPAWN_HALF_SIZE = 0.1
MAX_HEIGHT = CUBE_HALF_SIZE + 5e-3  # of the cube's centre while it counts as on the table
PUSH_OFFSET = -CUBE_HALF_SIZE - 0.005  # from the cube to where the TCP should push, along x
PUSH_RADIUS = 0.01  # around that point


@register_task("PushCube-v1", "maniskill.push_cube_native")
class PushCube(MultiRobotTask):
    """Push a cube away from the arm onto a round target.

    The cube is drawn from a square of 0.2 m around the origin, and the target lies 0.2 m behind
    it. Success: the cube is within 10 cm of the target's middle, seen from above, and on the
    table.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/push_cube.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 4

    def build(self, world: World) -> None:
        """Add the table, the cube and the target."""
        add_table(world)
        add_cube(world, "cube", CUBE_HALF_SIZE, (0.0, 0.0, CUBE_HALF_SIZE), DARK_BLUE)
        add_target(world, GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the table and the target behind it."""
        xy = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0]
        x, y = xy.tolist()
        world.set_pose("cube", (x, y, CUBE_HALF_SIZE))
        world.set_pose("goal_region", ((xy[0] + GOAL_OFFSET).item(), y, TARGET_HEIGHT), FACE_UP)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: over the target and on the table."""
        over = state.planar_distance("cube", "goal_region") < _GOAL_RADIUS
        return {"success": over & (state.position("cube")[:, 2] < _MAX_HEIGHT)}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, target and cube."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_region"),
            "obj_pose": state.pose("cube"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1); from there place (1) and keep down (1); 4 on success."""
        cube = state.position("cube")
        push_distance = norm(cube + _PUSH_OFFSET - state.tcp_position("arm"))
        reach, place, down = closeness(
            push_distance,
            state.planar_distance("cube", "goal_region"),
            np.abs(cube[:, 2] - _CUBE_HALF_SIZE),
        )
        reached = push_distance < _PUSH_RADIUS
        reward = reach + place * reached + place * down * reached
        return np.where(info["success"], _DONE, reward)


_GOAL_RADIUS, _MAX_HEIGHT, _PUSH_RADIUS = constants(GOAL_RADIUS, MAX_HEIGHT, PUSH_RADIUS)
_CUBE_HALF_SIZE, _DONE = constants(CUBE_HALF_SIZE, 4.0)
_PUSH_OFFSET = np.array([PUSH_OFFSET, 0.0, 0.0], np.float32)
