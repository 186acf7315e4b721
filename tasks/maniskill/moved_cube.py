"""What PushCube and PullCube share: a cube, and a round target on one side of it."""

from __future__ import annotations

from typing import ClassVar

from layouts import single
from tasks import (
    DARK_BLUE,
    FACE_UP,
    TARGET_HEIGHT,
    Cube,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    Target,
    Vector3,
    World,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, norm

# mani_skill 3.0.1, envs/tasks/tabletop/push_cube.py and pull_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.1
GOAL_DISTANCE = 0.1 + GOAL_RADIUS  # of the target from the cube, along x
SPAWN_HALF_SIZE = 0.1
TOUCH_RADIUS = 0.01  # around where the TCP should move the cube from


class MovedCube(Clone):
    """Move a cube along x onto a round target.

    Attributes:
        direction: 1 if the target lies farther along x than the cube, -1 if it lies before it.
        touch_offset: From the cube to where the TCP should move it from, x, y, z (m).
    """

    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    direction: ClassVar[int]
    touch_offset: ClassVar[Vector3]

    cube = Cube(CUBE_HALF_SIZE, DARK_BLUE)
    goal_region = Target(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the table and the target behind it or before it."""
        xy = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0]
        x, y = xy.tolist()
        goal_x = (xy[0] + self.direction * GOAL_DISTANCE).item()
        world.set_pose("cube", (x, y, CUBE_HALF_SIZE))
        world.set_pose("goal_region", (goal_x, y, TARGET_HEIGHT), FACE_UP)

    def over_target(self, state: State) -> Array:
        """Tell whether the cube is within the target's radius, seen from above; (N,) bool."""
        return state.planar_distance("cube", "goal_region") < GOAL_RADIUS

    def touch_distance(self, state: State) -> Floats:
        """Return how far the TCP is from where it should move the cube from, (N,) (m)."""
        touch = state.position("cube") + state.array(self.touch_offset)
        return norm(touch - state.tcp_position("arm"))

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, target and cube."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_region"),
            "obj_pose": state.pose("cube"),
        }
