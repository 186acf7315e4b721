"""CellHoldAndPush: the holder presses and stays, then the others push."""

from __future__ import annotations

from functools import partial

from robot_layouts.experts.cells.tips import press_down, push
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.hold_and_push import PUSHERS, CellHoldAndPush


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
                    )
                    for arm in PUSHERS
                },
            }
            for depth, strokes in ((0.02, 12), (0.04, 16))
        ],
        as_declared=True,
    )
