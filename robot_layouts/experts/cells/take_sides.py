"""CellTakeSides: every tip goes behind its block and pushes it to its mark."""

from __future__ import annotations

from functools import partial

from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.take_sides import SIDES, CellTakeSides

# Strokes of a push, how far behind its block it begins (m), and whether a lost one is pushed again
TRIED = ((12, 0.1, False), (18, 0.09, False), (12, 0.1, True))


def take_sides(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that push the blocks to their sides."""
    sides = SIDES[seed % len(CellTakeSides.instruction) % len(SIDES)]

    def mark(scene: Scene, name: str) -> Floats:
        return scene.body(name)[0]

    def script(strokes: int, gap: float, again: bool) -> Script:
        return {
            arm: push(
                task,
                arm,
                f"block_{arm}",
                partial(mark, name=f"{side}_{arm}"),
                strokes=strokes,
                gap=gap,
                again=again,
            )
            for arm, side in zip(task.layout.arms, sides, strict=True)
        }

    return first_success(
        task, seed, lambda scene: [script(*tried) for tried in TRIED], as_declared=True
    )
