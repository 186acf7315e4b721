"""CellPackTote: all arms take their things, and let them into the tote by turns."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import need_fingers, thing_grips
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.pack_tote import PARTS, CellPackTote

PLACES = {  # where things are let go, in the tote's frame (m)
    "south": (0.0, -0.045, 0.08),
    "east": (0.09, 0.0, 0.09),
    "north": (0.0, 0.045, 0.09),
    "west": (-0.09, 0.0, 0.09),
}


def pack_tote(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that pack the tote.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "packing the tote", *PARTS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, until: str) -> Script:
    before = dict(pairwise(reversed(PARTS)))  # by arm, after whom it puts its thing down
    can = thing_grips(CellPackTote.can.descriptor, "can", 0.08, lean=0.1)
    return {
        arm: carry(
            task,
            arm,
            part,
            can if part == "can" else cube_holds(part),
            partial(_inside, arm=arm),
            height=0.1,
            ready=0.03,
            around=0.01,
            turn_of=[f"{before[arm]}.{until} {PARTS[before[arm]]}"] if arm in before else [],
        )
        for arm, part in PARTS.items()
    }


def _inside(scene: Scene, arm: str) -> Floats:
    place, quaternion = scene.body("tote")
    return place + rotate(quaternion, np.array(PLACES[arm]))
