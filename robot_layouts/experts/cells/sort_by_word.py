"""CellSortByWord: all arms at once lay their cubes on the pads that they are told."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.sort_by_word import CHOICES, HALF, THICK

OWN_SIDE = 0.035  # of a pad's middle, where an arm lays its cube (m)


def sort_by_word(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that sort the cubes.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "sorting cubes", *task.layout.arms)
    choice = CHOICES[seed % len(CHOICES)]
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, choice, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, choice: tuple[str, ...], until: str) -> Script:
    arms = list(task.layout.arms)
    script = {}
    for i, (arm, side) in enumerate(zip(arms, choice, strict=True)):
        left, shared = arms[i - 1], (choice[i - 1], side) == ("right", "left")
        script[arm] = carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_place, arm=arm, pad=f"pad_{arm if side == 'right' else left}"),
            height=0.08,
            yaws=YAWS,
            turn_of=[f"{left}.{until} cube_{left}"] if shared else [],
        )
    return script


def _place(scene: Scene, arm: str, pad: str) -> Floats:
    """Return where an arm lays its cube on a pad: at its own side of it."""
    middle = scene.body(pad)[0]
    way = (scene.base(arm) - middle) * (1.0, 1.0, 0.0)
    return middle + OWN_SIDE * way / np.linalg.norm(way) + np.array([0.0, 0.0, THICK + HALF])
