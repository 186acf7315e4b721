"""CellPassAround: one arm after the other takes the cube to its zone; the last lifts it."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, stand_back
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.pass_around import HALF


def pass_around(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that hand the cube on.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "handing the cube on", *task.layout.arms)
    return first_success(
        task, seed, lambda scene: [_script(task, height) for height in (0.12, 0.08)]
    )


def _script(task: TaskEnv, height: float) -> Script:
    arms = list(task.layout.arms)
    return {
        arm: (
            stand_back(task, arm),
            *carry(
                task,
                arm,
                "cube",
                cube_holds("cube"),
                partial(_zone, arm=arm),
                height=height,
                yaws=YAWS,
                taking=[f"{before}.retreat cube"] if before else [],
            ),
        )
        for arm, before in zip(arms, ["", *arms[:-1]], strict=True)
    }


def _zone(scene: Scene, arm: str) -> Floats:
    return np.array([*scene.body(f"zone_{arm}")[0][:2], HALF])
