"""Scripted experts: for a task and a seed, the actions that solve it.

Finding experts:
    find_expert, list_experts, register_expert: An `Expert` by the id of its task.

Writing one, which is a function of a task and a seed:
    first_success: Tries scripts in a private copy of the task; the actions of the first that works.
    Script, Waypoint, Scene: What each robot does, one thing after the other, in worlds as seen now.
    pick, cube_grips, thing_grips: Waypoints that grasp a body, and where a gripper may hold it.
    grasp, carry, bring, lift, place, release, hold: Skills of any arm that has fingers on any thing
        that has grasps; each chooses a way that is in reach and has room.
    operate, press, insert, pour, pouring: Joints that are moved or pushed, pegs, vessels.
    hand_over, lift_together: Skills of several arms.
    resting, point_at: Where a thing rests, and where a point of it is.
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
from robot_layouts.experts.skills import (
    bring,
    carry,
    grasp,
    hold,
    insert,
    lift,
    operate,
    place,
    point_at,
    pour,
    pouring,
    press,
    release,
    resting,
)
from robot_layouts.experts.together import hand_over, lift_together

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
    "bring",
    "bringing",
    "carry",
    "cube_grips",
    "find_expert",
    "first_success",
    "follow",
    "grasp",
    "gripper_facing",
    "hand_over",
    "heading",
    "held_at",
    "hold",
    "holding",
    "in_reach",
    "insert",
    "is_near",
    "lift",
    "lift_together",
    "list_experts",
    "move_joint",
    "moved_along",
    "need_fingers",
    "operate",
    "pick",
    "place",
    "planar_distance",
    "point_at",
    "pour",
    "pouring",
    "press",
    "register_expert",
    "rehearse",
    "release",
    "resting",
    "search",
    "thing_grips",
    "turn",
    "yaw_of",
]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
