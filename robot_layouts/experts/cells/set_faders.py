"""CellSetFaders: every tip goes behind its fader and pushes it to its number."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import advance
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.set_faders import SETTINGS, STEP, CellSetFaders

BEHIND = np.array([-0.09, 0.0, -0.012])  # of a tip from the top of a cap, along its rail (m)
AHEAD = np.array([1.0, 0.0, 0.0])


def set_faders(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that set the faders."""
    setting = SETTINGS[seed % len(CellSetFaders.instruction) % len(SETTINGS)]
    wanted = dict(zip(task.layout.arms, setting, strict=True))
    point = np.array(CellSetFaders.fader_first.descriptor.points["cap"].position)

    def start(scene: Scene, arm: str) -> Floats:
        place, quaternion = scene.body(f"fader_{arm}.cap")
        return place + rotate(quaternion, point + BEHIND)

    def ahead(scene: Scene, arm: str) -> Floats:
        return rotate(scene.body(f"fader_{arm}")[1], AHEAD)

    def left(scene: Scene, arm: str) -> float:
        return STEP * wanted[arm] - scene.joints(f"fader_{arm}")["cap"]

    def script(strokes: int) -> Script:
        return {
            arm: advance(
                task,
                arm,
                f"fader_{arm}",
                partial(start, arm=arm),
                partial(ahead, arm=arm),
                partial(left, arm=arm),
                strokes=strokes,
            )
            for arm in wanted
        }

    return first_success(
        task, seed, lambda scene: [script(strokes) for strokes in (14, 20)], as_declared=True
    )
