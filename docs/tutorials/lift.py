"""An expert for TwoArmTray-v1: two grippers take the tray by its ends and lift it together."""

from functools import partial
from math import pi

import numpy as np
from tray import TwoArmTray

from robot_layouts.experts import (
    CLOSED,
    Waypoint,
    bringing,
    first_success,
    gripper_facing,
    need_fingers,
    pick,
    register_expert,
    yaw_of,
)

ENDS = {"left": -0.25, "right": 0.25}  # along the tray's own y axis (m)
HEIGHTS = np.linspace(0.02, 0.23, 9)[1:]  # of the tray, step by step (m)


def grips(scene, robot):
    """Poses of the gripper that hold this robot's end from above; the nearest is taken."""
    middle, quaternion = scene.body("tray")
    yaw = yaw_of(quaternion)
    along = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    place = middle + ENDS[robot] * along
    return [(place, gripper_facing(yaw + turned, tilt=0.0)) for turned in (-pi / 2, pi / 2)]


def raised(scene, robot, start, level, height):
    """Where the gripper goes so that the tray is at a height, level."""
    return [bringing(scene, robot, "tray", (np.array([*start[:2], height]), level))]


def script(scene):
    """What each robot does, waypoint by waypoint; `after` waits for the other robot."""
    start, level = scene.body("tray")
    waypoints = {}
    for robot, other in (("left", "right"), ("right", "left")):
        waits = [f"{other}.grasp tray", *(f"{other}.raise {i}" for i in range(len(HEIGHTS)))]
        lift = [
            Waypoint(
                f"raise {i}",
                partial(raised, robot=robot, start=start, level=level, height=height),
                CLOSED,
                after=(waits[i],),
            )
            for i, height in enumerate(HEIGHTS)
        ]
        waypoints[robot] = [*pick(robot, "tray", partial(grips, robot=robot)), *lift]
    return waypoints


def lift_tray(task, seed):
    """Return the actions (T, A) that solve the episode of a seed."""
    need_fingers(task, "lifting the tray", "left", "right")
    return first_success(task, seed, lambda scene: [script(scene)])


register_expert(TwoArmTray.task_id, lift_tray)
