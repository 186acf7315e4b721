"""CellHandMugOn: one arm after the other carries the mug by its rim, while a tip pushes."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from robot_layouts.experts.cells.moves import Place, carry, rim_holds, stand_back
from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.hand_mug_on import THICK, CellHandMugOn

# On which side of the rim hands take the mug, seen from their arms (rad), and strokes of the push.
TRIED = ((0.0, 16), (pi / 2, 24), (-pi / 2, 20), (0.0, 30))


def hand_mug_on(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that hand the mug on.

    Raises:
        TaskError: If giver or taker has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "handing the mug on", "giver", "taker")
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, *tried) for tried in TRIED],
        as_declared=True,
    )


def _script(task: TaskEnv, side: float, strokes: int) -> Script:
    def handing(arm: str, place: Place, **turns: Any) -> tuple[Waypoint, ...]:
        grips = rim_holds(CellHandMugOn.mug.descriptor, "mug", arm, side)
        return carry(task, arm, "mug", grips, place, yaws=YAWS, back=0.1, around=0.01, **turns)

    pushing = push(task, "pusher", "trivet", _mark, strokes=strokes, gap=0.16)
    return {
        "giver": (*handing("giver", _spot), stand_back(task, "giver")),
        "taker": (
            stand_back(task, "taker"),
            *handing("taker", _top, taking=["giver.wait"], turn_of=["pusher.wait"]),
        ),
        "pusher": (*pushing, stand_back(task, "pusher")),
    }


def _spot(scene: Scene) -> Floats:
    return scene.body("spot")[0] * (1.0, 1.0, 0.0)


def _mark(scene: Scene) -> Floats:
    return scene.body("mark")[0]


def _top(scene: Scene) -> Floats:
    return scene.body("trivet")[0] + np.array([0.0, 0.0, THICK])
