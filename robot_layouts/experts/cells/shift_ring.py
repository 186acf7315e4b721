"""CellShiftRing: all arms pick, and each puts its cube down where the next one's was."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.shift_ring import HALF


def shift_ring(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that pass the cubes on.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "passing cubes on", *task.layout.arms)
    return first_success(
        task, seed, lambda scene: [_script(task, height) for height in (0.12, 0.08, 0.16)]
    )


def _script(task: TaskEnv, height: float) -> Script:
    arms = list(task.layout.arms)
    return {
        arm: carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_zone, arm=arm),
            height=height,
            yaws=YAWS,
            turn_of=[f"{after}.lift cube_{after}"],
        )
        for arm, after in zip(arms, [*arms[1:], arms[0]], strict=True)
    }


def _zone(scene: Scene, arm: str) -> Floats:
    return np.array([*scene.body(f"zone_{arm}")[0][:2], HALF])
