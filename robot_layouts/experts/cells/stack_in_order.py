"""CellStackInOrder: all arms pick, and lay their cubes on the tower one after the other."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.stack_in_order import HALF, ORDERS


def stack_in_order(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that build the tower.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    order = ORDERS[seed % len(ORDERS)]
    need_fingers(task, "building the tower", *order)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, order, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, order: tuple[str, ...], until: str) -> Script:
    return {
        arm: carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_place, level=level),
            height=0.08,
            yaws=YAWS,
            turn_of=[f"{below}.{until} cube_{below}"] if below else [],
        )
        for level, (arm, below) in enumerate(zip(order, ["", *order[:-1]], strict=True))
    }


def _place(scene: Scene, level: int) -> Floats:
    return np.array([*scene.body("mark")[0][:2], (2 * level + 1) * HALF])
