"""CellPressInOrder: all arms wait over their buttons; each presses once the one before it has."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import press_down
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.press_in_order import CellPressInOrder, order_of


def press_in_order(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that press the buttons in their order."""
    order = order_of(seed % len(CellPressInOrder.instruction))
    point = np.array(CellPressInOrder.button_south.descriptor.points["top"].position)

    def top(scene: Scene, arm: str) -> Floats:
        return scene.body(f"button_{arm}")[0] + point

    def script(depth: float) -> Script:
        return {
            arm: press_down(
                task,
                arm,
                f"button_{arm}",
                partial(top, arm=arm),
                depth,
                after=[f"{before}.press button_{before}"] if before else [],
            )
            for arm, before in zip(order, ("", *order[:-1]), strict=True)
        }

    return first_success(
        task,
        seed,
        lambda scene: [script(depth) for depth in (0.012, 0.02, 0.035)],
        as_declared=True,
    )
