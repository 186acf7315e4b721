"""TwoRobotPushPick: a stick pushes a cube within a gripper's reach, which picks it."""

from __future__ import annotations

from math import pi

from layouts import face_to_face
from tasks import (
    DARK_RED,
    Area,
    Camera,
    Cube,
    Friction,
    Goal,
    Info,
    MultiRobotTask,
    Needs,
    PhysicsSettings,
    State,
    closeness,
    register_task,
)
from tasks.maths import Array, Floats, maximum, norm, where

# m; the picker's base is at y = 0.7, and a Panda that points down reaches about 0.8 m
CUBE_HALF_SIZE = 0.02
IN_REACH_Y = -0.05  # from here on the cube counts as within reach
GOAL_RADIUS = 0.025
PUSH_OFFSET = -0.03  # from the cube's middle to where a stick pushes it, along y
STATIC_SPEED = 0.2  # rad/s


@register_task("TwoRobotPushPick-v1")
class TwoRobotPushPick(MultiRobotTask):
    """Push a cube from where only the pusher reaches it to the picker, which holds it at a goal.

    The cube lies at x in [-0.1, 0.1], y in [-0.28, -0.2], turned by at most 30°; the goal is at x
    in [-0.1, 0.1], y in [0.15, 0.25] and 0.1 to 0.3 high (m). Success: the cube is within 2.5 cm
    of the goal, the picker grasps it and is static.
    """

    source = "robot-layouts; geometry and rewards are its own"
    layout = face_to_face({"pusher": "panda_stick", "picker": "panda_wristcam"}, spacing=1.4)
    needs = {"picker": Needs(fingers=True, opening=2 * CUBE_HALF_SIZE)}
    physics = PhysicsSettings()
    max_episode_steps = 150
    max_reward = 8
    viewpoint = ((1.4, 0.4, 0.75), (0.0, 0.0, 0.1))
    cameras = (Camera((1.0, 0.0, 0.75), (0.0, 0.0, 0.1)),)
    sensed = ("*_tcp_pose", "goal_pos", "is_cube_grasped")

    cube = Cube(
        CUBE_HALF_SIZE,
        DARK_RED,
        friction=Friction(1.0, 1.0, 0.0),  # so that a stick does not slip off at once
        spawn=Area(x=(-0.1, 0.1), y=(-0.28, -0.2), yaw=(-pi / 6, pi / 6)),
    )
    goal_site = Goal(GOAL_RADIUS, spawn=Area(x=(-0.1, 0.1), y=(0.15, 0.25), z=(0.1, 0.3)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: placed, and held by the picker, which is static."""
        placed = state.distance("cube", "goal_site") <= GOAL_RADIUS
        grasped = state.is_grasping("picker", "cube")
        return {
            "is_cube_in_reach": state.position("cube")[:, 1] >= IN_REACH_Y,
            "is_cube_grasped": grasped,
            "is_cube_placed": placed,
            "success": placed & grasped & state.is_static("picker", STATIC_SPEED),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both TCPs, cube and goal, and the ways between them."""
        return {
            "pusher_tcp_pose": state.tcp_pose("pusher"),
            "picker_tcp_pose": state.tcp_pose("picker"),
            "cube_pose": state.pose("cube"),
            "goal_pos": state.position("goal_site"),
            "pusher_tcp_to_cube_pos": state.tcp_offset("pusher", "cube"),
            "picker_tcp_to_cube_pos": state.tcp_offset("picker", "cube"),
            "cube_to_goal_pos": state.offset("cube", "goal_site"),
            "is_cube_grasped": info["is_cube_grasped"],
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach and push (1), approach (2), grasp and carry (5), hold still (7); 8 on success."""
        cube = state.position("cube")
        push_place = cube + state.array((0.0, PUSH_OFFSET, 0.0))
        reach, across, take, carry, still = closeness(
            norm(push_place - state.tcp_position("pusher")),
            maximum(IN_REACH_Y - cube[:, 1], 0.0),
            state.tcp_distance("picker", "cube"),
            state.distance("cube", "goal_site"),
            state.arm_speed("picker"),
        )
        grasped = info["is_cube_grasped"]
        reward = (reach + across) * 0.5
        reward = where(info["is_cube_in_reach"], 1.0 + take, reward)
        reward = where(grasped, 3.0 + 2.0 * carry, reward)
        reward = where(grasped & info["is_cube_placed"], 6.0 + still, reward)
        return where(info["success"], 8.0, reward)
