"""CellLoadTray: the lifters raise the tray together, then the loader sets the cube down on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, lift_together
from robot_layouts.experts.grasps import in_reach, need_fingers, thing_grips
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.load_tray import HALF, HEIGHT, CellLoadTray

HANDLES = {"west": "left handle", "east": "right handle"}
NARROW = -0.2  # action number of a gripper that fits between a handle and the tray
LEGS = 4
ABOVE = 0.006  # of the tray's origin, where the cube comes to lie (m)


def load_tray(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that raise the tray and load it.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "loading the tray", "loader", *HANDLES)
    tray = CellLoadTray.tray.descriptor
    grips = {
        arm: in_reach(
            task,
            arm,
            thing_grips(
                replace(tray, grasps=tuple(g for g in tray.grasps if g.part == part)), "tray", 0.08
            ),
        )
        for arm, part in HANDLES.items()
    }

    def on(scene: Scene) -> Floats:
        return scene.body("tray")[0] + np.array([0.0, 0.0, ABOVE + HALF])

    def script(legs: int) -> Script:
        lifting = lift_together(
            "tray", grips, HEIGHT + 0.02, legs=legs, ready=0.03, around=0.01, opening=NARROW
        )
        up = [f"{arm}.raise {legs - 1}" for arm in HANDLES]
        loading = carry(
            task, "loader", "cube", cube_holds("cube"), on, height=0.16, back=0.1, turn_of=up
        )
        return {"loader": loading, **lifting}

    return first_success(
        task, seed, lambda scene: [script(legs) for legs in (LEGS, 2 * LEGS)], as_declared=True
    )
