"""PullCube: pull a cube onto a target between it and the arm."""

from __future__ import annotations

from tasks import Camera, Info, State, closeness, register_task
from tasks.maniskill.moved_cube import CUBE_HALF_SIZE, TOUCH_RADIUS, MovedCube
from tasks.maths import Array, Floats, where

# mani_skill 3.0.1, envs/tasks/tabletop/pull_cube.py (m)
PULL_OFFSET = CUBE_HALF_SIZE + 2 * 0.005  # from the cube to where the TCP should pull, along x


@register_task("PullCube-v1", "maniskill.pull_cube_native")
class PullCube(MovedCube):
    """Pull a cube towards the arm onto a round target.

    The cube is drawn from a square of 0.2 m around the origin, and the target lies 0.2 m before
    it. Success: the cube is within 10 cm of the target's middle, seen from above; its height does
    not count.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pull_cube.py"
    max_reward = 3
    direction = -1
    touch_offset = (PULL_OFFSET, 0.0, 0.0)
    cameras = (Camera((-0.5, 0.0, 0.25), (0.2, 0.0, -0.5)),)
    sensed = ("tcp_pose", "goal_pos")

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: over the target."""
        return {"success": self.over_target(state)}

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach behind the cube (1); from there place (1); 3 on success."""
        pull_distance = self.touch_distance(state)
        reach, place = closeness(pull_distance, state.planar_distance("cube", "goal_region"))
        reward = reach + place * (pull_distance < TOUCH_RADIUS)
        return where(info["success"], 3.0, reward)
