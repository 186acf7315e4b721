"""Scripted experts: for a task and a seed, the actions that solve it.

Finding experts:
    find_expert, list_experts, register_expert: An `Expert` by the id of its task.

Writing one, which is a function of a task and a seed:
    first_success: Tries scripts in a private copy of the task; the actions of the first that works.
    Script, Waypoint, Scene: What each robot does, one thing after the other, in worlds as seen now.
    pick, cube_grips, thing_grips: Waypoints that grasp a body, and where a gripper may hold it.
    move_joint, moved_along: Waypoints that open or turn what a gripper holds.
    in_reach: Those grips that an arm can come to.
    need_fingers: Refuses robots that cannot.
    bringing, holding, held_at, is_near: Where the gripper goes with what it holds.
    gripper_facing, turn, yaw_of, heading, backed_off, planar_distance: Poses and headings.
    rehearse: A closed loop in the place of a script: a function of what is seen, at every step.
    Rehearsal, search, Attempt, Plan: What these are made of, for plans that are made on the way.
    ArmDriver: Turns joints to go to into action numbers.

Carrying out a planned `robot_layouts.motion.Motion`, in any control mode:
    follow: Steps a task until its robots have; `Followed` says how near they stayed.
    Follower: The action of one step after the other.

``examples/two_arm_tray.ipynb`` writes one from the first line to the last.
"""

from robot_layouts.core.own_packages import expect_own

expect_own("robots", "layouts", "tasks")

from robot_layouts.experts.driver import ArmDriver
from robot_layouts.experts.following import Followed, Follower, follow
from robot_layouts.experts.geometry import (
    backed_off,
    gripper_facing,
    heading,
    planar_distance,
    turn,
    yaw_of,
)
from robot_layouts.experts.grasps import (
    bringing,
    cube_grips,
    held_at,
    holding,
    in_reach,
    is_near,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    thing_grips,
)
from robot_layouts.experts.registry import Expert, find_expert, list_experts, register_expert
from robot_layouts.experts.rehearsal import (
    Attempt,
    Plan,
    Rehearsal,
    first_success,
    rehearse,
    search,
)
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint

__all__ = [
    "CLOSED",
    "OPEN",
    "ArmDriver",
    "Attempt",
    "Expert",
    "Followed",
    "Follower",
    "Plan",
    "Pose",
    "Rehearsal",
    "Scene",
    "Script",
    "Waypoint",
    "backed_off",
    "bringing",
    "cube_grips",
    "find_expert",
    "first_success",
    "follow",
    "gripper_facing",
    "heading",
    "held_at",
    "holding",
    "in_reach",
    "is_near",
    "list_experts",
    "move_joint",
    "moved_along",
    "need_fingers",
    "pick",
    "planar_distance",
    "register_expert",
    "rehearse",
    "search",
    "thing_grips",
    "turn",
    "yaw_of",
]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
