"""TwoRobotHandOver: one arm picks a cube and gives it to the other, which holds it at a goal."""

from __future__ import annotations

from math import pi

from layouts import face_to_face
from tasks import (
    DARK_RED,
    Area,
    Camera,
    Cube,
    Goal,
    Info,
    MultiRobotTask,
    Needs,
    PhysicsSettings,
    State,
    closeness,
    register_task,
)
from tasks.maths import Array, Floats, where

# For two Pandas (m); other robots' are as much larger as `fit` says.
CUBE_HALF_SIZE = 0.02
GOAL_RADIUS = 0.025
HEIGHT = 0.1  # of the cube at least, when the second arm takes it
STATIC_SPEED = 0.2  # rad/s


@register_task("TwoRobotHandOver-v1")
class TwoRobotHandOver(MultiRobotTask):
    """Hand a cube over in the air, to the arm that holds it at a goal.

    Between the arms lies a frame, its y axis from the left to the right one. In it the cube lies at
    x in [-0.05, 0.05], y in [-0.15, -0.1], turned at random; the goal is at x in [-0.05, 0.05], y
    in [0.1, 0.15] and 0.1 to 0.2 high (m, for two Pandas; larger or smaller for other robots).
    Success: the cube is within 2.5 cm of the goal, the right arm alone holds it and is static.
    """

    source = "robot-layouts; geometry and rewards are its own"
    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
    needs = {"*": Needs(fingers=True, opening=2 * CUBE_HALF_SIZE)}
    fits_robots = True
    physics = PhysicsSettings()
    max_episode_steps = 600  # small arms move by 0.3 rad per second
    max_reward = 9
    viewpoint = ((1.4, 0.4, 0.75), (0.0, 0.0, 0.1))
    cameras = (Camera((1.0, 0.0, 0.75), (0.0, 0.0, 0.1)),)
    sensed = ("*_tcp_pose", "goal_pos", "is_left_grasping", "is_right_grasping")

    cube = Cube(
        CUBE_HALF_SIZE,
        DARK_RED,
        spawn=Area(x=(-0.05, 0.05), y=(-0.15, -0.1), yaw=(-pi, pi)),
    )
    goal_site = Goal(GOAL_RADIUS, spawn=Area(x=(-0.05, 0.05), y=(0.1, 0.15), z=(0.1, 0.2)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: placed, and held by the right arm alone, which is static."""
        left, right = state.is_grasping("left", "cube"), state.is_grasping("right", "cube")
        placed = state.distance("cube", "goal_site") <= GOAL_RADIUS
        return {
            "is_left_grasping": left,
            "is_right_grasping": right,
            "is_cube_placed": placed,
            "success": placed & right & ~left & state.is_static("right", STATIC_SPEED),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both TCPs, the cube, the goal, and the ways between them."""
        return {
            "left_tcp_pose": state.tcp_pose("left"),
            "right_tcp_pose": state.tcp_pose("right"),
            "cube_pose": state.pose("cube"),
            "goal_pos": state.position("goal_site"),
            "left_tcp_to_cube_pos": state.tcp_offset("left", "cube"),
            "right_tcp_to_cube_pos": state.tcp_offset("right", "cube"),
            "cube_to_goal_pos": state.offset("cube", "goal_site"),
            "is_left_grasping": info["is_left_grasping"],
            "is_right_grasping": info["is_right_grasping"],
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1), grasp and lift (3), take over (5), carry (7), hold still (8); 9 on success."""
        height = state.position("cube")[:, 2]
        reach, lift, take, carry, still = closeness(
            state.tcp_distance("left", "cube"),
            (HEIGHT - height).clip(0.0),
            state.tcp_distance("right", "cube"),
            state.distance("cube", "goal_site"),
            state.arm_speed("right"),
        )
        left, right = info["is_left_grasping"], info["is_right_grasping"]
        reward = where(left, 1.0 + lift + take, reach)
        reward = where(left & right, 4.0, reward)
        reward = where(right & ~left, 5.0 + 2.0 * carry, reward)
        reward = where(right & ~left & info["is_cube_placed"], 7.0 + still, reward)
        return where(info["success"], 9.0, reward)
