"""CellThrowLevers: the named arms go behind their levers and sweep them over."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import sweep
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.throw_levers import PAIRS

PIVOT = 0.07  # of a lever over the table (m)
FIRST, LAST = -1.3, 0.4  # rad from upright; of the tip about the pivot
WIDE, NARROWS = 0.08, 0.32  # by which its way is wider at first, and how fast that goes (m)


def throw_levers(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that throw the named levers."""

    def path(scene: Scene, share: float, arm: str, end: float) -> Floats:
        place, quaternion = scene.body(f"lever_{arm}")
        angle, radius = FIRST + share * (LAST - FIRST), end + max(0.0, WIDE - share * NARROWS)
        tip = (radius * np.sin(angle), 0.0, PIVOT + radius * np.cos(angle))
        return place + rotate(quaternion, np.array(tip))

    def script(end: float) -> Script:
        return {
            arm: sweep(task, arm, f"lever_{arm}", partial(path, arm=arm, end=end))
            for arm in PAIRS[seed % len(PAIRS)]
        }

    return first_success(
        task, seed, lambda scene: [script(end) for end in (0.12, 0.1, 0.14)], as_declared=True
    )
