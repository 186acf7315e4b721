"""CellPassGlass: one arm after the other carries the cup by its rim; then the third presses."""

from __future__ import annotations

from functools import partial
from math import pi
from typing import Any

import numpy as np

from robot_layouts.experts.cells.moves import Place, carry, rim_holds, stand_back
from robot_layouts.experts.cells.tips import press_down
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.pass_glass import CellPassGlass

# On which side of the rim hands take the cup, seen from their arms (rad), and how deep it presses.
TRIED = ((0.0, 0.02), (pi / 2, 0.03), (-pi / 2, 0.04))


def pass_glass(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that pass the cup on and ring.

    Raises:
        TaskError: If giver or taker has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "passing the cup on", "giver", "taker")
    return first_success(
        task, seed, lambda scene: [_script(task, *tried) for tried in TRIED], as_declared=True
    )


def _script(task: TaskEnv, side: float, depth: float) -> Script:
    def passing(arm: str, mark: str, **turns: Any) -> tuple[Waypoint, ...]:
        grips = rim_holds(CellPassGlass.cup.descriptor, "cup", arm, side)
        place: Place = partial(_on, mark=mark)
        return carry(task, arm, "cup", grips, place, yaws=YAWS, back=0.1, around=0.01, **turns)

    return {
        "giver": (*passing("giver", "spot"), stand_back(task, "giver")),
        "taker": (
            stand_back(task, "taker"),
            *passing("taker", "mark", taking=["giver.wait"]),
        ),
        "ringer": press_down(task, "ringer", "bell", _top, depth, after=["taker.retreat cup"]),
    }


def _on(scene: Scene, mark: str) -> Floats:
    return scene.body(mark)[0] * (1.0, 1.0, 0.0)


def _top(scene: Scene) -> Floats:
    return scene.body("bell")[0] + np.array(CellPassGlass.bell.descriptor.points["top"].position)
