"""TwoRobotPickCube: the left arm brings a cube to the right arm, which holds it at a goal."""

from __future__ import annotations

from layouts import face_to_face
from tasks import (
    Camera,
    Cube,
    EpisodeRandom,
    Goal,
    Info,
    PhysicsSettings,
    State,
    World,
    closeness,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, floats, maximum, norm, tanh, where

# mani_skill 3.0.1, envs/tasks/tabletop/two_robot_pick_cube.py (m)
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.025
STATIC_SPEED = 0.2  # rad/s


@register_task("TwoRobotPickCube-v1", "maniskill.two_robot_pick_cube_native")
class TwoRobotPickCube(Clone):
    """Hand a cube over: it starts out of the right arm's reach, the goal is out of the left's.

    The cube lies at y in [-0.2, -0.1], the goal at y in [0.1, 0.2], both with x in
    [-0.05, 0.05] (m). Success: the cube is within 2.5 cm of the goal and the right arm static.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/two_robot_pick_cube.py"
    layout = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.5)
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 21
    shared_joint_noise = True  # native gives both arms one draw
    viewpoint = ((1.4, 0.8, 0.75), (0.0, 0.1, 0.1))
    cameras = (Camera((1.0, 0.0, 0.75), (0.0, 0.0, 0.25)),)
    sensed = ("left_arm_tcp", "right_arm_tcp")

    cube = Cube(CUBE_HALF_SIZE)
    goal_site = Goal(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the left and the goal on the right."""
        x = rng.uniform(1) * 0.1 - 0.05
        y = -0.15 - rng.uniform(1) * 0.1 + 0.05
        world.set_pose("cube", (x.item(), y.item(), CUBE_HALF_SIZE), rng.yaw_quaternion())
        x = rng.uniform(1) * 0.1 - 0.05
        y = 0.15 + rng.uniform(1) * 0.1 - 0.05
        z = rng.uniform(1) * 0.3 + CUBE_HALF_SIZE
        world.set_pose("goal_site", (x.item(), y.item(), z.item()))

    def remember(self, state: State) -> dict[str, Array]:
        """Where the left arm started."""
        return {"left_start": state.qpos("left")}

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: placed, and the right arm static."""
        placed = state.distance("cube", "goal_site") <= GOAL_RADIUS
        static = state.is_static("right", STATIC_SPEED)
        return {
            "success": placed & static,
            "is_obj_placed": placed,
            "is_right_arm_static": static,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both TCPs, the cube, and the ways between them."""
        return {
            "left_arm_tcp": state.tcp_pose("left"),
            "right_arm_tcp": state.tcp_pose("right"),
            "cube_pose": state.pose("cube"),
            "left_arm_tcp_to_cube_pos": state.tcp_offset("left", "cube"),
            "right_arm_tcp_to_cube_pos": state.tcp_offset("right", "cube"),
            "cube_to_goal_pos": state.offset("cube", "goal_site"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Bring (2), take over (8), carry (12), place (19), hold still (21 on success)."""
        cube_y = state.position("cube")[:, 1]
        to_goal = state.tcp_distance("right", "goal_site")
        reach, across, take, retreat, carry, right_still, left_still, *fingers = closeness(
            state.tcp_distance("left", "cube"),
            maximum(0.05 - cube_y, 0.0),
            state.tcp_distance("right", "cube"),
            abs(state.tcp_position("left")[:, 1] - -0.2),
            to_goal,
            state.arm_speed("right"),
            state.arm_speed("left"),
            *_finger_errors(state),
        )
        grasped = state.is_grasping("right", "cube")
        strayed = norm(state.qpos("left") - self.memory.left_start)
        stage_1 = (reach + across) * 0.5
        ready = (fingers[0] + fingers[1]) * 0.5 if fingers else 0.0
        stage_2 = take + ready + retreat + 2.0 * floats(grasped)
        stage_3 = 2.0 * carry + (1.0 - tanh(strayed))
        stage_5 = (right_still + left_still) * 0.5

        reward = where(cube_y >= 0.0, 2.0 + stage_2, stage_1)
        reward = where(grasped, 8.0 + stage_3, reward)
        reward = where((to_goal < 0.25) & grasped, 12.0 + 2.0 * stage_3, reward)
        reward = where(info["is_obj_placed"], 19.0 + stage_5, reward)
        return where(info["success"], 21.0, reward)


def _finger_errors(state: State) -> tuple[Floats, ...]:
    """How far the right fingers are from level and from open, (N,) each (m); none, no errors."""
    heights = state.finger_heights("right")
    if heights is None:
        return ()
    return abs(heights[0] - heights[1]), abs(state.finger_gap("right") - 0.07)
