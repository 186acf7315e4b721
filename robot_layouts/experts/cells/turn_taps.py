"""CellTurnTaps: every tip goes behind its handle and pushes it round to its number."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import sweep
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, inverse, rotate
from tasks import TaskEnv
from tasks.cells.turn_taps import NOTCH, SETTINGS, CellTurnTaps

BEHIND, LEAST = -1.0, 0.12  # rad; of a tip from a handle that is shut, and of a stroke
HEIGHT = 0.168  # of the tip's way about a tap (m)
# In how many strokes a tip goes round, and how far from the middle (m); wide tips, outside.
TRIED = (14, 0.077), (20, 0.077), (20, 0.085), (20, 0.092)


def turn_taps(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that open the taps."""
    setting = SETTINGS[seed % len(CellTurnTaps.instruction) % len(SETTINGS)]
    wanted = dict(zip(task.layout.arms, setting, strict=True))

    def path(scene: Scene, share: float, arm: str, count: int, radius: float) -> Floats:
        """The tip's next place on its way round: a share of what is left, once it began."""
        place, quaternion = scene.body(f"tap_{arm}")
        x, y, _ = rotate(inverse(quaternion), scene.tcp(arm)[0] - place)
        left = NOTCH * wanted[arm] - scene.joints(f"tap_{arm}")["handle"]
        strokes = count * (1 - share) + 1
        turn = max(left / strokes, min(LEAST, left))
        angle = np.arctan2(y, x) + turn if share else BEHIND
        tip = np.array([radius * np.cos(angle), radius * np.sin(angle), HEIGHT])
        return place + rotate(quaternion, tip)

    def script(count: int, radius: float) -> Script:
        way = partial(path, count=count, radius=radius)
        return {
            arm: sweep(task, arm, f"tap_{arm}", partial(way, arm=arm), count=count)
            for arm in wanted
        }

    return first_success(
        task, seed, lambda scene: [script(*tried) for tried in TRIED], as_declared=True
    )
