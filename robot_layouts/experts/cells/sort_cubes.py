"""CellSortCubes: all arms at once lay one cube on the pad to their right, then the other."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.sort_cubes import HALF, NEAREST, SIDES, THICK

OWN_SIDE = 0.035  # of a pad's middle, where an arm lays its cube (m)
BEFORE = {"first": "third", "second": "first", "third": "second"}


def sort_cubes(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that sort the cubes.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "sorting cubes", *SIDES)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, patient) for patient in (False, True)],
        as_declared=True,
    )


def _script(task: TaskEnv, patient: bool) -> Script:
    script = {}
    for arm, (right, left) in NEAREST.items():
        waits = [f"{BEFORE[arm]}.{'retreat' if patient else 'rise'} {BEFORE[arm]}_{left}"]
        own = (
            carry(
                task,
                arm,
                f"{arm}_{color}",
                cube_holds(f"{arm}_{color}"),
                partial(_place, arm=arm, color=color),
                height=0.08,
                yaws=YAWS,
                turn_of=after,
            )
            for color, after in ((right, []), (left, waits))
        )
        script[arm] = tuple(waypoint for waypoints in own for waypoint in waypoints)
    return script


def _place(scene: Scene, arm: str, color: str) -> Floats:
    """Return where an arm lays its cube on a pad: at its own side of it."""
    pad = scene.body(f"pad_{color}")[0]
    way = (scene.base(arm) - pad) * (1.0, 1.0, 0.0)
    return pad + OWN_SIDE * way / np.linalg.norm(way) + np.array([0.0, 0.0, THICK + HALF])
