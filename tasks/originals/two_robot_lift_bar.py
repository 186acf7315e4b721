"""TwoRobotLiftBar: two arms lift a bar that is too long for one, and keep it level."""

from __future__ import annotations

from math import cos, pi, radians

from layouts import face_to_face
from tasks import (
    DARK_BLUE,
    RED,
    Area,
    Box,
    Camera,
    Compound,
    Info,
    MultiRobotTask,
    Needs,
    PhysicsSettings,
    State,
    closeness,
    register_task,
    transform,
)
from tasks.maths import Array, Flags, Floats, arccos, clip, maximum, norm, where

# Of the bar, along its own x axis (m): two thin ends and a middle wider than a Panda's gripper
# opens, which is 0.08 m.
HALF_THICKNESS = 0.02
MIDDLE_HALF_LENGTH, MIDDLE_HALF_WIDTH = 0.1, 0.06
END_HALF_LENGTH = 0.1
GRIP = 0.25  # of a gripper from the bar's middle
DENSITY = 500.0  # kg/m³, of wood: 0.8 kg in all, 1 N m about a grip

LARGEST_TURN = radians(20)  # of the bar from the way between the arms
HEIGHT = 0.2  # of the bar's middle (m)
LARGEST_TILT = radians(5)
STATIC_SPEED = 0.2  # rad/s


def bar_shapes() -> tuple[Box, ...]:
    """Return the bar's middle and its two ends."""
    thick = HALF_THICKNESS
    middle = Box(
        half_size=(MIDDLE_HALF_LENGTH, MIDDLE_HALF_WIDTH, thick), density=DENSITY, color=RED
    )
    ends = [
        Box(
            half_size=(END_HALF_LENGTH, thick, thick),
            position=(side * (MIDDLE_HALF_LENGTH + END_HALF_LENGTH), 0.0, 0.0),
            density=DENSITY,
            color=DARK_BLUE,
        )
        for side in (-1, 1)
    ]
    return (middle, *ends)


@register_task("TwoRobotLiftBar-v1")
class TwoRobotLiftBar(MultiRobotTask):
    """Lift a bar of 0.6 m with a gripper at each end, level, and hold it still.

    The bar is 4 cm thick, 12 cm wide at its middle, and weighs 0.8 kg. Its middle lies at x in
    [-0.05, 0.05], y in [-0.03, 0.03] (m), turned by at most 20° from the y axis. Success: its
    middle is at least 0.2 m high, it is tilted by at most 5° about any level axis, both arms hold
    it and are static.
    """

    source = "robot-layouts; geometry and rewards are its own"
    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
    needs = {"*": Needs(fingers=True, opening=2 * HALF_THICKNESS)}
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 7
    viewpoint = ((1.4, 0.4, 0.75), (0.0, 0.0, 0.15))
    cameras = (Camera((1.0, 0.0, 0.75), (0.0, 0.0, 0.1)),)
    sensed = ("*_tcp_pose", "is_left_grasping", "is_right_grasping")

    bar = Compound(
        bar_shapes(),
        HALF_THICKNESS,
        start=(0.0, 0.0, HALF_THICKNESS),
        spawn=Area(  # its +x end towards +y
            x=(-0.05, 0.05),
            y=(-0.03, 0.03),
            yaw=(pi / 2 - LARGEST_TURN, pi / 2 + LARGEST_TURN),
        ),
    )

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: lifted, level, held by both arms, which are static."""
        left, right = state.is_grasping("left", "bar"), state.is_grasping("right", "bar")
        lifted = state.position("bar")[:, 2] >= HEIGHT
        level = state.rotation("bar")[:, 2, 2] >= cos(LARGEST_TILT)
        static = state.is_static("left", STATIC_SPEED) & state.is_static("right", STATIC_SPEED)
        return {
            "is_bar_lifted": lifted,
            "is_bar_level": level,
            "is_left_grasping": left,
            "is_right_grasping": right,
            "success": lifted & level & left & right & static,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both TCPs, the bar, and the ways from each TCP to where it is to grip."""
        return {
            "left_tcp_pose": state.tcp_pose("left"),
            "right_tcp_pose": state.tcp_pose("right"),
            "bar_pose": state.pose("bar"),
            "left_tcp_to_grip_pos": _to_grip(state, "left"),
            "right_tcp_to_grip_pos": _to_grip(state, "right"),
            "is_left_grasping": info["is_left_grasping"],
            "is_right_grasping": info["is_right_grasping"],
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1), grasp (2), lift (4) level (5) and hold still (6); 7 on success."""
        left, right = info["is_left_grasping"], info["is_right_grasping"]
        below = maximum(HEIGHT - state.position("bar")[:, 2], 0.0)
        upright = clip(state.rotation("bar")[:, 2, 2], -1.0, 1.0)
        reach_left, reach_right, lift, level, still_left, still_right = closeness(
            norm(_to_grip(state, "left")),
            norm(_to_grip(state, "right")),
            below,
            arccos(upright),
            state.arm_speed("left"),
            state.arm_speed("right"),
        )
        both: Flags = left & right
        reward = (reach_left + reach_right + left + right) * 0.5
        reward = where(both, 2.0 + 2.0 * lift + level, reward)
        raised = both & info["is_bar_lifted"] & info["is_bar_level"]
        reward = where(raised, 5.0 + (still_left + still_right) * 0.5, reward)
        return where(info["success"], 7.0, reward)


def _to_grip(state: State, robot: str) -> Floats:
    """Way from a robot's TCP to its grip on the bar, shape (N, 3) (m, world)."""
    return transform(state.pose("bar"), state.array(_GRIPS[robot])) - state.tcp_position(robot)


_GRIPS = {"left": ((-GRIP, 0.0, 0.0),), "right": ((GRIP, 0.0, 0.0),)}  # in the bar's frame
