"""TwoRobotStackCube: one arm puts its cube on a target, the other stacks its own on top."""

from __future__ import annotations

from layouts import face_to_face
from tasks import (
    DARK_BLUE,
    FACE_UP,
    GREEN,
    TARGET_HEIGHT,
    Cube,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    Target,
    World,
    closeness,
    diagonal,
    distance_to_top,
    letting_go,
    lies_on,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, norm, rounded, tanh, where

# mani_skill 3.0.1, envs/tasks/tabletop/two_robot_stack_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.06
GOAL_Y = -0.1
TOLERANCE = 0.005  # beyond half a cube's diagonal
PUSH_GAP = 0.005  # between the green cube's far side and where the right arm pushes it
RETREAT_Y = 0.2


@register_task("TwoRobotStackCube-v1", "maniskill.two_robot_stack_cube_native")
class TwoRobotStackCube(Clone):
    """Put the right arm's green cube (cubeB) on a target, the left arm's blue one (cubeA) on it.

    The blue cube lies at y in [-0.2, -0.1], the green one at y in [0.1, 0.2], the target at
    y = -0.1, all with x in [-0.05, 0.05] (m). Success: the blue cube lies on the green one to
    within half a cube, the green one is within 6 cm of the target, and neither is grasped.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/two_robot_stack_cube.py"
    layout = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.5)
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 10
    shared_joint_noise = True  # native gives both arms one draw
    viewpoint = ((0.6, 0.2, 0.4), (-0.1, 0.0, 0.1))
    sensed = ("left_arm_tcp", "right_arm_tcp")

    cubeA = Cube(CUBE_HALF_SIZE, DARK_BLUE, start=(1.0, 0.0, CUBE_HALF_SIZE))
    cubeB = Cube(CUBE_HALF_SIZE, GREEN, start=(-1.0, 0.0, CUBE_HALF_SIZE))
    goal_region = Target(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay a cube before each arm, and the target between them."""
        rng.uniform(1, 2)  # native draws these and does not use them
        left_x = rng.uniform(1) * 0.1 - 0.05
        left_y = -0.15 - rng.uniform(1) * 0.1 + 0.05
        right_x = rng.uniform(1) * 0.1 - 0.05
        right_y = 0.15 + rng.uniform(1) * 0.1 - 0.05
        for cube, x, y in (("cubeA", left_x, left_y), ("cubeB", right_x, right_y)):
            world.set_pose(cube, (x.item(), y.item(), CUBE_HALF_SIZE), rng.yaw_quaternion())
        x = rng.uniform(1) * 0.1 - 0.05
        world.set_pose("goal_region", (x.item(), GOAL_Y, TARGET_HEIGHT), FACE_UP)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: target reached, stacked, and both let go."""
        stacked = lies_on(state, "cubeA", "cubeB", _ASIDE, 2 * CUBE_HALF_SIZE)
        placed = state.planar_distance("cubeB", "goal_region") < GOAL_RADIUS
        left, right = state.is_grasping("left", "cubeA"), state.is_grasping("right", "cubeB")
        return {
            "is_cubeA_grasped": left,
            "is_cubeB_grasped": right,
            "is_cubeA_on_cubeB": stacked,
            "cubeB_placed": placed,
            "success": stacked & placed & ~left & ~right,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both TCPs, the target, the cubes, and the ways between them."""
        return {
            "left_arm_tcp": state.tcp_pose("left"),
            "right_arm_tcp": state.tcp_pose("right"),
            "goal_region_pos": state.position("goal_region"),
            "cubeA_pose": state.pose("cubeA"),
            "cubeB_pose": state.pose("cubeB"),
            "left_arm_tcp_to_cubeA_pos": state.tcp_offset("left", "cubeA"),
            "right_arm_tcp_to_cubeB_pos": state.tcp_offset("right", "cubeB"),
            "cubeA_to_cubeB_pos": state.offset("cubeA", "cubeB"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Grasp blue (1), place green (3), stack and retreat (7), let go (9); 10 on success."""
        left, right = info["is_cubeA_grasped"], info["is_cubeB_grasped"]
        push_place = state.position("cubeB") + state.array(_PUSH_OFFSET)
        push_distance = norm(push_place - state.tcp_position("right"))
        reach, place, stack, retreat = closeness(
            state.tcp_distance("left", "cubeA"),
            state.planar_distance("cubeB", "goal_region"),
            distance_to_top(state, "cubeA", "cubeB", 2 * CUBE_HALF_SIZE),
            abs(state.tcp_position("right")[:, 1] - RETREAT_Y),
        )
        both_reach = (reach + 1.0 - tanh(5.0 * push_distance)) * 0.5
        released = letting_go(state, "left", left, 1.0) + letting_go(state, "right", right, 1.0)

        reward = where(left, 2.0 + (place + left) * 0.5, (both_reach + left) * 0.5)
        placed = info["cubeB_placed"]
        reward = where(placed & left, 4.0 + (stack * 2.0 + retreat), reward)
        stacked = info["is_cubeA_on_cubeB"] & placed
        reward = where(stacked, 8.0 + released * 0.5, reward)
        return where(info["success"], 10.0, reward)


_ASIDE = diagonal(CUBE_HALF_SIZE, TOLERANCE)
_PUSH_OFFSET = (0.0, rounded(CUBE_HALF_SIZE) + rounded(PUSH_GAP), 0.0)
