"""CellGatherBlocks: each tip goes behind its block and pushes it onto the mark."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.gather_blocks import SIDES

# how far from the middle blocks come to lie (m), in how many strokes; of `push`, gap and height (m)
TRIED = (
    (0.16, 8, 0.08, 0.025),
    (0.16, 14, 0.08, 0.025),
    (0.14, 14, 0.08, 0.025),
    (0.16, 8, 0.1, 0.035),
)


def gather_blocks(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that gather the blocks."""
    return first_success(
        task, seed, lambda scene: [_script(task, *tried) for tried in TRIED], as_declared=True
    )


def _script(task: TaskEnv, end: float, strokes: int, gap: float, height: float) -> Script:
    how = partial(push, strokes=strokes, gap=gap, height=height)
    return {arm: how(task, arm, f"block_{arm}", partial(_on_mark, arm, end)) for arm in SIDES}


def _on_mark(arm: str, end: float, scene: Scene) -> Floats:
    """Return the place so far from the middle on the way to an arm's block (m)."""
    place = scene.body(f"block_{arm}")[0]
    return end * place / np.linalg.norm(place[:2])
