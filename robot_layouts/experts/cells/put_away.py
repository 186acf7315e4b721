"""CellPutAway: one arm pulls the drawer open and holds it, the other lets the can into it."""

from __future__ import annotations

from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry
from robot_layouts.experts.grasps import (
    in_reach,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    thing_grips,
)
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene
from tasks import TaskEnv
from tasks.cells.put_away import CellPutAway

PULLED = 0.15  # m
OVER = (0.0, -0.03, 0.06)  # from the drawer to where the can is let go (m)


def put_away(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of both arms, (T, A), that put the can away.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "putting the can away", "opener", "packer")

    def pull(scene: Scene, grip: Pose) -> list[Pose]:
        return [moved_along(scene, "case", "drawer", at, grip) for at in (0.05, 0.1, PULLED)]

    def inside(scene: Scene) -> np.ndarray:
        return scene.part("case", "drawer", PULLED)[0] + OVER

    handle = thing_grips(CellPutAway.case.descriptor, "case", 0.08, lean=pi / 2)
    can = thing_grips(CellPutAway.can.descriptor, "can", 0.08, lean=0.1)
    script = {
        "opener": [
            *pick(
                "opener",
                "case.drawer",
                in_reach(task, "opener", handle, on=pull),
                ready=0.03,
                around=0.01,
            ),
            *move_joint("opener", "case", "drawer", PULLED),
        ],
        "packer": carry(
            task,
            "packer",
            "can",
            can,
            inside,
            turn_of=["opener.case.drawer 7"],
            ready=0.03,
            around=0.01,
        ),
    }
    return first_success(task, seed, lambda scene: [script], as_declared=True)
