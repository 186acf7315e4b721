"""CellTwoHandPress: the loader pushes and stands back, then the others press together."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import stand_back
from robot_layouts.experts.cells.tips import press_down, push
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.two_hand_press import SIDES, CellTwoHandPress


def two_hand_press(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that load the press and start it."""
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, *tried) for tried in ((16, 0.03), (22, 0.04), (28, 0.03))],
        as_declared=True,
    )


def _script(task: TaskEnv, strokes: int, depth: float) -> Script:
    def die(scene: Scene) -> Floats:
        return scene.body("die")[0]

    load = push(task, "loader", "block", die, strokes=strokes)
    return {
        "loader": (*load, stand_back(task, "loader")),
        **{
            arm: press_down(task, arm, "control", partial(_top, cap), depth, after=["loader.wait"])
            for arm, cap in SIDES.items()
        },
    }


def _top(cap: str, scene: Scene) -> Floats:
    place, quaternion = scene.body("control")
    point = CellTwoHandPress.control.descriptor.points[cap].position
    return place + rotate(quaternion, np.array(point))
