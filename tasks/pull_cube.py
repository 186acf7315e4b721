"""PullCube: pull a cube onto a target between it and the arm."""

from __future__ import annotations

import numpy as np

from layouts import single
from simulation import Camera, PhysicsSettings, State, World, add_table
from simulation.arrays import Array, Floats, constants, norm
from tasks.props import DARK_BLUE, FACE_UP, TARGET_HEIGHT, add_cube, add_target
from tasks.randomness import EpisodeRandom
from tasks.registry import register_task
from tasks.shaping import closeness
from tasks.task import Info, MultiRobotTask

# mani_skill 3.0.1, envs/tasks/tabletop/pull_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.1
GOAL_OFFSET = 0.1 + GOAL_RADIUS  # of the target from the cube, against x
SPAWN_HALF_SIZE = 0.1
PULL_OFFSET = CUBE_HALF_SIZE + 2 * 0.005  # from the cube to where the TCP should pull, along x
PULL_RADIUS = 0.01  # around that point


@register_task("PullCube-v1", "maniskill.pull_cube_native")
class PullCube(MultiRobotTask):
    """Pull a cube towards the arm onto a round target.

    The cube is drawn from a square of 0.2 m around the origin, and the target lies 0.2 m before
    it. Success: the cube is within 10 cm of the target's middle, seen from above; its height does
    not count.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pull_cube.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 3
    cameras = (Camera((-0.5, 0.0, 0.25), (0.2, 0.0, -0.5)),)
    sensed = ("tcp_pose", "goal_pos")

    def build(self, world: World) -> None:
        """Add the table, the cube and the target."""
        add_table(world)
        add_cube(world, "cube", CUBE_HALF_SIZE, (0.0, 0.0, CUBE_HALF_SIZE), DARK_BLUE)
        add_target(world, GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the table and the target before it."""
        xy = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0]
        x, y = xy.tolist()
        world.set_pose("cube", (x, y, CUBE_HALF_SIZE))
        world.set_pose("goal_region", ((xy[0] - GOAL_OFFSET).item(), y, TARGET_HEIGHT), FACE_UP)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: over the target."""
        return {"success": state.planar_distance("cube", "goal_region") < _GOAL_RADIUS}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, target and cube."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_region"),
            "obj_pose": state.pose("cube"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach behind the cube (1); from there place (1); 3 on success."""
        pull_distance = norm(state.position("cube") + _PULL_OFFSET - state.tcp_position("arm"))
        reach, place = closeness(pull_distance, state.planar_distance("cube", "goal_region"))
        reward = reach + place * (pull_distance < _PULL_RADIUS)
        return np.where(info["success"], _DONE, reward)


_GOAL_RADIUS, _PULL_RADIUS, _DONE = constants(GOAL_RADIUS, PULL_RADIUS, 3.0)
_PULL_OFFSET = np.array([PULL_OFFSET, 0.0, 0.0], np.float32)
