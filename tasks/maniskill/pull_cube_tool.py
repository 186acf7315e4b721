"""PullCubeTool: pull a cube into reach with an L-shaped tool."""

from __future__ import annotations

from math import pi

from layouts import single
from tasks import (
    DARK_BLUE,
    POLISHED,
    RED,
    Box,
    Camera,
    Compound,
    Cube,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    World,
    closeness,
    once_per_state,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Flags, Floats, floats, norm, tanh, where

# mani_skill 3.0.1, envs/tasks/tabletop/pull_cube_tool.py (m)
CUBE_HALF_SIZE = 0.02
HANDLE_LENGTH = 0.2
HOOK_LENGTH = 0.05
WIDTH = 0.05
HEIGHT = 0.05
HANDLE_DENSITY = 500.0  # kg/m³; the hook keeps 1000
ARM_REACH = 0.35  # as native's formulas take it
CUBE_HEIGHT = 0.02 / 2 + 0.015  # of its middle above the table at a reset: it drops by 5 mm
PULLED_DISTANCE = 0.6  # of the cube from the robot's base, seen from above
MAX_GRASP_ANGLE = 20.0  # degrees; of the tool, for the reward


def tool_shapes() -> tuple[Box, Box]:
    """Return handle and hook; the origin is the handle's end."""
    handle = Box(
        half_size=(HANDLE_LENGTH / 2, WIDTH / 2, HEIGHT / 2),
        position=(HANDLE_LENGTH / 2, 0.0, 0.0),
        density=HANDLE_DENSITY,
        color=RED,
        finish=POLISHED,
    )
    hook = Box(
        half_size=(HOOK_LENGTH / 2, WIDTH, HEIGHT / 2),
        position=(HANDLE_LENGTH - HOOK_LENGTH / 2, WIDTH, 0.0),
        color=RED,
        finish=POLISHED,
    )
    return handle, hook


@register_task("PullCubeTool-v1", "maniskill.pull_cube_tool_native")
class PullCubeTool(Clone):
    """Grasp an L-shaped tool and pull a cube with it that is out of the arm's reach.

    The tool's end lies at x and y in [-0.3, -0.1], the cube at x in [0.05, 0.25] and y in
    [-0.25, 0.05] (m), turned by up to 30°. Success: the cube is within 0.6 m of the robot's base,
    seen from above.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pull_cube_tool.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 5
    cameras = (Camera((0.3, 0.0, 0.5), (-0.1, 0.0, 0.1)),)

    cube = Cube(CUBE_HALF_SIZE, DARK_BLUE, start=(0.0, 0.0, 0.0))
    l_shape_tool = Compound(tool_shapes())

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the tool before the robot and the cube beyond its reach."""
        x, y = (-rng.uniform(1, 2) * 0.2 - 0.1)[0].tolist()
        world.set_pose("l_shape_tool", (x, y, HEIGHT / 2))
        x = ARM_REACH + rng.uniform(1) * HANDLE_LENGTH - 0.3
        y = rng.uniform(1) * 0.3 - 0.25
        turn = rng.yaw_quaternion(-pi / 6, pi / 6)
        world.set_pose("cube", (x.item(), y.item(), CUBE_HEIGHT), turn)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the cube is near the robot.

        Progress and distance are kept per environment; native averages them over its batch.
        """
        success = self._success(state)
        centre = state.base_position("arm") + state.array(_CENTRE)
        distance = _distance(state.position("cube"), centre)
        return {
            "success": success,
            "success_once": success,  # native's words for the same
            "success_at_end": success,
            "cube_progress": 1.0 - tanh(3.0 * distance),
            "cube_distance": distance,
            "reward": self._staged_reward(state) / 5.0,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, cube and tool."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "cube_pose": state.pose("cube"),
            "tool_pose": state.pose("l_shape_tool"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach and grasp the tool (4), place it behind the cube, pull; 5 more on success.

        While the tool is grasped its place is worth up to 1.5, and the way that a well-placed tool
        has pulled the cube up to 3. A cube that was pushed away costs 2.
        """
        return self._staged_reward(state)

    @once_per_state
    def _success(self, state: State) -> Flags:
        way = state.position("cube") - state.base_position("arm")
        return norm(way[:, :2]) < PULLED_DISTANCE

    @once_per_state
    def _staged_reward(self, state: State) -> Floats:
        cube, tool = state.position("cube"), state.position("l_shape_tool")
        target = state.base_position("arm") + state.array(_TARGET)
        (reach,) = closeness(_distance(state.tcp_position("arm"), tool + state.array(_GRASP)))
        grasped = state.is_grasping("arm", "l_shape_tool", MAX_GRASP_ANGLE)
        hook_error = _distance(tool, cube + state.array(_BEHIND_CUBE))
        placed = 1.5 * (1.0 - tanh(3.0 * hook_error))
        start = _distance(state.array(_CUBE_START), target)
        progress = (start - _distance(cube, target)) / start
        pulled = 3.0 * progress * (hook_error < 0.05)

        reward = 2.0 * reach + 2.0 * floats(grasped) + placed * grasped + pulled * grasped
        reward = where(cube[:, 0] > ARM_REACH + 0.15, reward - 2.0, reward)
        return where(self._success(state), reward + 5.0, reward)


def _distance(start: Floats, end: Floats) -> Floats:
    """Distance between points (N, 3), shape (N,) (m)."""
    return norm(start - end)


_CENTRE = (ARM_REACH * 0.1, 0.0, 0.0)  # from the base (m)
_TARGET = (0.05, 0.0, 0.0)  # from the base (m)
_GRASP = (0.02, 0.0, 0.0)  # from the tool's end (m)
# Where the tool's end belongs, seen from the cube (m)
_BEHIND_CUBE = (-(HOOK_LENGTH + CUBE_HALF_SIZE), -0.067, 0.0)
_CUBE_START = (ARM_REACH + 0.1, 0.0, 0.01)  # what progress counts from (m)
