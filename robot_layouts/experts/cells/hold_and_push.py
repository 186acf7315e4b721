"""CellHoldAndPush: the holder presses and stays, then the others push."""

from __future__ import annotations

from functools import partial

from robot_layouts.experts.cells.tips import press_down, push
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.hold_and_push import PUSHERS, CellHoldAndPush

# How deep the button is pressed (m), strokes of a push, and whether a lost block is pushed again
TRIED = ((0.02, 12, False), (0.04, 16, False), (0.02, 16, True))


def hold_and_push(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that hold the button and push the blocks."""
    point = CellHoldAndPush.button.descriptor.points["top"].position

    def top(scene: Scene) -> Floats:
        return scene.body("button")[0] + point

    def mark(scene: Scene, arm: str) -> Floats:
        return scene.body(f"mark_{arm}")[0]

    return first_success(
        task,
        seed,
        lambda scene: [
            {
                "holder": press_down(task, "holder", "button", top, depth),
                **{
                    arm: push(
                        task,
                        arm,
                        f"block_{arm}",
                        partial(mark, arm=arm),
                        strokes=strokes,
                        after=["holder.press button"],
                        again=again,
                    )
                    for arm in PUSHERS
                },
            }
            for depth, strokes, again in TRIED
        ],
        as_declared=True,
    )
