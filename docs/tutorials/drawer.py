"""PutAway: one arm opens a drawer, the other puts a can into it; the task and its expert."""

from functools import partial
from math import pi

import numpy as np

from layouts import face_to_face
from robot_layouts.experts import (
    CLOSED,
    OPEN,
    Waypoint,
    first_success,
    held_at,
    in_reach,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    register_expert,
    thing_grips,
)
from tasks import Area, MultiRobotTask, Object, register_task

OPENED = 0.15  # m
INSIDE = (0.0, -0.03, 0.14)  # m from the drawer to the can above it


@register_task("PutAway-v1")
class PutAway(MultiRobotTask):
    """Open the drawer and put the can into it."""

    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)  # m
    max_episode_steps = 200

    case = Object("drawer", kind="kinematic", spawn=Area(x=(0.27, 0.31), y=0.2, yaw=-pi / 2))
    can = Object("can", spawn=Area(x=(-0.1, 0.0), y=(0.2, 0.3)))

    def evaluate(self, state):
        """Success: the drawer is open, and the can in it, let go."""
        opened = state.joint("case", "drawer") > 0.8 * OPENED
        inside = state.planar_distance("case.drawer", "can") < 0.1
        low = state.position("can")[:, 2] < 0.12
        held = state.is_grasping("right", "can")
        return {"opened": opened, "success": opened & inside & low & ~held}


def script(scene, handle, can):
    """What each arm does; the right one waits until the drawer is open."""

    def inside(scene):
        place = scene.body("case.drawer")[0] + INSIDE
        return held_at(scene, "right", "can", place, np.linspace(-2, 2, 9), (0.0, 0.4))

    return {
        "left": [
            *pick("left", "case.drawer", handle, ready=0.03, around=0.01),
            *move_joint("left", "case", "drawer", OPENED),
        ],
        "right": [
            *pick("right", "can", can, ready=0.03, around=0.01),
            Waypoint("lift", partial(raised, robot="right"), CLOSED),
            Waypoint("carry", inside, CLOSED, after=("left.case.drawer 7",)),
            Waypoint("let go", None, OPEN, steps=15),
        ],
    }


def raised(scene, robot):
    """Where a gripper is, 20 cm higher."""
    position, quaternion = scene.tcp(robot)
    return [(position + (0.0, 0.0, 0.2), quaternion)]


def put_away(task, seed):
    """Return the actions (T, A) that solve the episode of a seed."""
    need_fingers(task, "putting the can away", "left", "right")

    def pull(scene, grip):
        return [moved_along(scene, "case", "drawer", way, grip) for way in (0.05, 0.1, OPENED)]

    handle = thing_grips(PutAway.case.descriptor, "case", 0.08, lean=pi / 2)
    handle = in_reach(task, "left", handle, on=pull)
    can = in_reach(task, "right", thing_grips(PutAway.can.descriptor, "can", 0.08, lean=0.1))
    return first_success(task, seed, lambda scene: [script(scene, handle, can)])


register_expert(PutAway.task_id, put_away)
