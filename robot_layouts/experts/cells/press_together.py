"""CellPressTogether: all arms wait over their buttons, then press."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.press_together import SIDES, TOP

OVER = 0.05  # of the tips, before all press (m)


def press_together(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that press the buttons at once."""
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, depth) for depth in (0.015, 0.03, 0.05)],
        as_declared=True,
    )


def _script(task: TaskEnv, depth: float) -> Script:
    go = partial(reaching, task, leans=(0.0, 0.3, -0.3, 0.6), as_it_is=False, gripper=CLOSED)
    return {
        arm: (
            go(robot=arm, name="high", place=partial(_over, arm=arm, up=2 * OVER), near=0.03),
            go(robot=arm, name="over", place=partial(_over, arm=arm, up=OVER), near=0.02),
            go(
                robot=arm,
                name="press",
                place=partial(_over, arm=arm, up=-depth),
                near=0.0,
                after=tuple(f"{other}.over" for other in SIDES if other != arm),
            ),
        )
        for arm in SIDES
    }


def _over(scene: Scene, arm: str, up: float) -> Floats:
    return scene.body(f"button_{arm}")[0] + np.array([0.0, 0.0, TOP + up])
