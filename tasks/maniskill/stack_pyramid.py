"""StackPyramid: put a blue cube on a red and a green one that stand side by side."""

from __future__ import annotations

from layouts import single
from tasks import (
    BLUE,
    GREEN,
    RED,
    Camera,
    Cube,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    World,
    diagonal,
    is_at_rest,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Flags

# mani_skill 3.0.1, envs/tasks/tabletop/stack_pyramid.py (m)
CUBE_HALF_SIZE = 0.02
SPAWN_HALF_SIZE = (0.1, 0.2)
TOLERANCE = 0.005  # beyond a cube's diagonal
MIN_HEIGHT = 0.02  # of one origin above another


@register_task("StackPyramid-v1", "maniskill.stack_pyramid_native")
class StackPyramid(Clone):
    """Push the red cube (cubeA) beside the green one (cubeB), put the blue one (cubeC) on both.

    All lie within 0.2 m × 0.4 m around the origin and do not touch. Success: red and green are
    neighbours, blue is next to both from above and at another height, red and blue are at rest
    and not grasped. As in native, blue counts as on top when it is lower, too, and green may
    move or be held.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/stack_pyramid.py"
    layout = single({"arm": "panda_wristcam"})
    physics = PhysicsSettings()
    max_episode_steps = 250
    reward_modes = ("none", "sparse")
    cameras = (Camera((0.3, 0.0, 0.4), (-0.05, 0.0, 0.1)),)

    cubeA = Cube(CUBE_HALF_SIZE, RED, start=(0.0, 0.0, 0.2))
    cubeB = Cube(CUBE_HALF_SIZE, GREEN, start=(1.0, 0.0, 0.2))
    cubeC = Cube(CUBE_HALF_SIZE, BLUE, start=(-1.0, 0.0, 0.2))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cubes on the table."""
        low = [-half for half in SPAWN_HALF_SIZE]
        places = rng.points_apart(3, low, SPAWN_HALF_SIZE, _APART)
        for cube, (x, y) in zip(("cubeA", "cubeB", "cubeC"), places.tolist(), strict=True):
            world.set_pose(cube, (x, y, CUBE_HALF_SIZE), rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: red beside green, blue on both, red and blue at rest and let go."""
        success = _is_beside(state, "cubeA", "cubeB")
        for base in ("cubeA", "cubeB"):
            success = success & _is_beside(state, base, "cubeC") & _differs_in_height(state, base)
        for cube in ("cubeA", "cubeC"):
            success = success & is_at_rest(state, cube) & ~state.is_grasping("arm", cube)
        return {"success": success}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, cubes, and the ways between them."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "cubeA_pose": state.pose("cubeA"),
            "cubeB_pose": state.pose("cubeB"),
            "cubeC_pose": state.pose("cubeC"),
            "tcp_to_cubeA_pos": state.tcp_offset("arm", "cubeA"),
            "tcp_to_cubeB_pos": state.tcp_offset("arm", "cubeB"),
            "tcp_to_cubeC_pos": state.tcp_offset("arm", "cubeC"),
            "cubeA_to_cubeB_pos": state.offset("cubeA", "cubeB"),
            "cubeB_to_cubeC_pos": state.offset("cubeB", "cubeC"),
            "cubeA_to_cubeC_pos": state.offset("cubeA", "cubeC"),
        }


def _is_beside(state: State, cube: str, other: str) -> Flags:
    """Whether two cubes are at most a diagonal apart, seen from above, shape (N,) bool."""
    return state.planar_distance(cube, other) <= _ASIDE


def _differs_in_height(state: State, base: str) -> Flags:
    """Whether the blue cube is higher or lower than another one, shape (N,) bool."""
    return abs(state.offset(base, "cubeC")[:, 2]) > MIN_HEIGHT


_ASIDE = diagonal(2 * CUBE_HALF_SIZE, TOLERANCE)
_APART = 2 * diagonal(CUBE_HALF_SIZE)
