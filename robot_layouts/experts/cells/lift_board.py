"""CellLiftBoard: each arm takes the tab before it, and all raise the board."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import lift_together
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import rotate
from tasks import TaskEnv
from tasks.cells.lift_board import GRIP, HEIGHT, SIDES


def lift_board(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that lift the board.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "lifting the board", *SIDES)
    grips = {arm: partial(_grips, arm=arm) for arm in SIDES}
    return first_success(
        task,
        seed,
        lambda scene: [
            lift_together("board", grips, HEIGHT + 0.02, legs=legs, near=near, ready=0.03)
            for legs, near in ((4, 0.04), (8, 0.02))
        ],
        as_declared=True,
    )


def _grips(scene: Scene, arm: str) -> list[Pose]:
    """The gripper straight down over a tab, its fingers on the tab's long sides."""
    position, quaternion = scene.body("board")
    x, y = SIDES[arm]
    place = position + rotate(quaternion, np.array([GRIP * x, GRIP * y, 0.0]))
    along = yaw_of(quaternion) + float(np.arctan2(y, x))
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]
