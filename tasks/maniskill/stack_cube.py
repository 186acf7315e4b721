"""StackCube: put a red cube on a green one and let go of it."""

from __future__ import annotations

from layouts import single
from tasks import (
    GREEN,
    RED,
    Cube,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    World,
    closeness,
    diagonal,
    distance_to_top,
    is_at_rest,
    letting_go,
    lies_on,
    register_task,
    stillness,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, where

# mani_skill 3.0.1, envs/tasks/tabletop/stack_cube.py (m)
CUBE_HALF_SIZE = 0.02
SPAWN_HALF_SIZE = (0.1, 0.2)
SPAWN_SHIFT = 0.1  # largest shift of that region along x and y
TOLERANCE = 0.005  # beyond half a cube's diagonal
GAP = 0.001


@register_task("StackCube-v1", "maniskill.stack_cube_native")
class StackCube(Clone):
    """Put the red cube (cubeA) on the green one (cubeB) and let go of it.

    Both lie within a region of 0.2 m × 0.4 m, shifted by up to 0.1 m along x and y, and do not
    touch. Success: the red cube lies on the green one to within half a cube, at rest, and is not
    grasped.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/stack_cube.py"
    layout = single({"arm": "panda_wristcam"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 8

    cubeA = Cube(CUBE_HALF_SIZE, RED, start=(0.0, 0.0, 0.1))
    cubeB = Cube(CUBE_HALF_SIZE, GREEN, start=(1.0, 0.0, 0.1))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay both cubes on the table."""
        shift = rng.uniform(1, 2) * (2 * SPAWN_SHIFT) - SPAWN_SHIFT
        low = [-half for half in SPAWN_HALF_SIZE]
        places = shift + rng.points_apart(2, low, SPAWN_HALF_SIZE, _APART)
        for cube, (x, y) in zip(("cubeA", "cubeB"), places.tolist(), strict=True):
            world.set_pose(cube, (x, y, CUBE_HALF_SIZE), rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: stacked, at rest and let go."""
        grasped = state.is_grasping("arm", "cubeA")
        stacked = lies_on(state, "cubeA", "cubeB", _ASIDE, 2 * CUBE_HALF_SIZE)
        static = is_at_rest(state, "cubeA")
        return {
            "is_cubeA_grasped": grasped,
            "is_cubeA_on_cubeB": stacked,
            "is_cubeA_static": static,
            "success": stacked & static & ~grasped,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, cubes, and the ways between them."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "cubeA_pose": state.pose("cubeA"),
            "cubeB_pose": state.pose("cubeB"),
            "tcp_to_cubeA_pos": state.tcp_offset("arm", "cubeA"),
            "tcp_to_cubeB_pos": state.tcp_offset("arm", "cubeB"),
            "cubeA_to_cubeB_pos": state.offset("cubeA", "cubeB"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (2), grasp and place (5), let go and come to rest (7); 8 on success."""
        grasped = info["is_cubeA_grasped"]
        reach, place = closeness(
            state.tcp_distance("arm", "cubeA"),
            distance_to_top(state, "cubeA", "cubeB", 2 * CUBE_HALF_SIZE),
        )
        released = letting_go(state, "arm", grasped, 1.0)
        stacked = 6.0 + (released + stillness(state, "cubeA")) * 0.5
        reward = where(grasped, 4.0 + place, 2.0 * reach)
        reward = where(info["is_cubeA_on_cubeB"], stacked, reward)
        return where(info["success"], 8.0, reward)


_ASIDE = diagonal(CUBE_HALF_SIZE, TOLERANCE)
_APART = 2 * diagonal(CUBE_HALF_SIZE, GAP)
