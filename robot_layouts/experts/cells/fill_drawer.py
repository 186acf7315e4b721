"""CellFillDrawer: one pulls and goes back, one lets the cube in, and one pushes the handle."""

from __future__ import annotations

from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, push_shut, set_down, stand_back
from robot_layouts.experts.grasps import (
    in_reach,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    thing_grips,
)
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.fill_drawer import CellFillDrawer

PULLED, LAST = 0.15, "case.drawer 7"  # how far (m), and the waypoint with which that is done
OVER = (0.04, -0.03, 0.1)  # of the cube when it is let go, from the open drawer (m)


def fill_drawer(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that fill the drawer.

    Raises:
        TaskError: If opener or filler has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "filling the drawer", "opener", "filler")
    return first_success(
        task, seed, lambda scene: [_script(task, up) for up in (0.05, 0.035)], as_declared=True
    )


def _script(task: TaskEnv, height: float) -> Script:
    case = CellFillDrawer.case.descriptor
    handle = in_reach(task, "opener", thing_grips(case, "case", 0.08, lean=pi / 2), on=_pull)
    return {
        "opener": (
            *pick("opener", "case.drawer", handle, ready=0.03, around=0.01),
            *move_joint("opener", "case", "drawer", PULLED),
            *set_down("case.drawer", ["opener"], LAST)["opener"],
            stand_back(task, "opener"),
        ),
        "filler": carry(
            task,
            "filler",
            "cube",
            cube_holds("cube"),
            _inside,
            height=0.1,
            turn_of=["opener.rise case.drawer"],
        ),
        "shutter": push_shut(
            task,
            "shutter",
            "case",
            handle=np.array(case.points["handle"].position),
            height=height,
            after=["filler.retreat cube", "opener.wait"],
        ),
    }


def _pull(scene: Scene, grip: Pose) -> list[Pose]:
    return [moved_along(scene, "case", "drawer", at, grip) for at in (0.05, 0.1, PULLED)]


def _inside(scene: Scene) -> Floats:
    return scene.part("case", "drawer", PULLED)[0] + OVER
