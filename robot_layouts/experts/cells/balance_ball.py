"""CellBalanceBall: each arm takes the tab before it; all raise the board and carry it over."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import lift_together
from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene
from tasks import TaskEnv
from tasks.cells.balance_ball import GRIP, HEIGHT, TABS

STYLES = ((4, 4, 0.04), (8, 8, 0.02), (12, 12, 0.02))  # steps up, steps over, and how near (rad)


def balance_ball(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that carry the board over the mark.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "balancing the ball", *TABS)
    grips = {arm: partial(_grips, arm=arm) for arm in TABS}
    return first_success(
        task,
        seed,
        lambda scene: [
            lift_together(
                "board",
                grips,
                HEIGHT + 0.02,
                legs=legs,
                onward=[partial(_nearer, left=moves - i) for i in range(moves)],
                near=near,
                ready=0.03,
            )
            for legs, moves, near in STYLES
        ],
        as_declared=True,
    )


def _grips(scene: Scene, arm: str) -> list[Pose]:
    """The gripper straight down over a tab, its fingers on the tab's long sides."""
    position, quaternion = scene.body("board")
    along = yaw_of(quaternion) + TABS[arm]
    place = position + GRIP * np.array([np.cos(along), np.sin(along), 0.0])
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]


def _nearer(scene: Scene, left: int) -> Pose:
    """Return the board's next pose on its way over the mark, turned as it is and level."""
    position, quaternion = scene.body("board")
    way = (scene.body("mark")[0] - position) * (1.0, 1.0, 0.0)
    return position + way / left, turn("z", yaw_of(quaternion))
