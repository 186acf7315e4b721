"""CellRaiseFrame: each arm takes the tab before it, and all raise the frame."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import lift_together
from robot_layouts.experts.geometry import gripper_facing, heading, yaw_of
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import rotate
from tasks import TaskEnv
from tasks.cells.raise_frame import GRIP, HEIGHT

MIDDLE = np.zeros(3)


def raise_frame(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that lift the frame.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "lifting the frame", *task.layout.arms)
    grips = {arm: partial(_grips, arm=arm) for arm in task.layout.arms}
    return first_success(
        task,
        seed,
        lambda scene: [
            lift_together("frame", grips, HEIGHT + 0.02, legs=legs, near=near, ready=0.03)
            for legs, near in ((4, 0.04), (8, 0.02))
        ],
    )


def _grips(scene: Scene, arm: str) -> list[Pose]:
    """The gripper straight down over a tab, its fingers on the tab's long sides."""
    position, quaternion = scene.body("frame")
    ahead = heading(MIDDLE, scene.base(arm))
    tab = np.array([GRIP * np.cos(ahead), GRIP * np.sin(ahead), 0.0])
    place, along = position + rotate(quaternion, tab), yaw_of(quaternion) + ahead
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]
