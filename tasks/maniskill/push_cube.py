"""PushCube: push a cube onto a target in front of it."""

from __future__ import annotations

from tasks import Info, State, closeness, register_task
from tasks.maniskill.moved_cube import CUBE_HALF_SIZE, TOUCH_RADIUS, MovedCube
from tasks.maths import Array, Floats, where

# mani_skill 3.0.1, envs/tasks/tabletop/push_cube.py (m)
MAX_HEIGHT = CUBE_HALF_SIZE + 5e-3  # of the cube's centre while it counts as on the table
PUSH_OFFSET = -CUBE_HALF_SIZE - 0.005  # from the cube to where the TCP should push, along x


@register_task("PushCube-v1", "maniskill.push_cube_native")
class PushCube(MovedCube):
    """Push a cube away from the arm onto a round target.

    The cube is drawn from a square of 0.2 m around the origin, and the target lies 0.2 m behind
    it. Success: the cube is within 10 cm of the target's middle, seen from above, and on the
    table.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/push_cube.py"
    max_reward = 4
    direction = 1
    touch_offset = (PUSH_OFFSET, 0.0, 0.0)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: over the target and on the table."""
        low = state.position("cube")[:, 2] < MAX_HEIGHT
        return {"success": self.over_target(state) & low}

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1); from there place (1) and keep down (1); 4 on success."""
        push_distance = self.touch_distance(state)
        reach, place, down = closeness(
            push_distance,
            state.planar_distance("cube", "goal_region"),
            abs(state.position("cube")[:, 2] - CUBE_HALF_SIZE),
        )
        reached = push_distance < TOUCH_RADIUS
        reward = reach + place * reached + place * down * reached
        return where(info["success"], 4.0, reward)
