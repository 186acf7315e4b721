"""CellRelay: each tip pushes and goes back before the next arm begins; the last one packs."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, stand_back
from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv

UP = np.array([0.0, 0.0, 0.05])  # of the block above the box's floor when it is let go (m)


def relay(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that bring the block into the box.

    Raises:
        TaskError: If the packer has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "packing the block", "packer")
    return first_success(
        task, seed, lambda scene: [_script(task, strokes) for strokes in (12, 18)], as_declared=True
    )


def _script(task: TaskEnv, strokes: int) -> Script:
    pushing = partial(push, task, body="block", strokes=strokes)
    first = pushing("first", end=partial(_place, name="corner"))
    second = pushing("second", end=partial(_place, name="end"), after=["first.wait"])
    return {
        "first": (*first, stand_back(task, "first")),
        "second": (*second, stand_back(task, "second")),
        "packer": (
            stand_back(task, "packer"),
            *carry(
                task,
                "packer",
                "block",
                cube_holds("block"),
                lambda scene: _place(scene, "box") + UP,
                taking=["second.wait"],
            ),
        ),
    }


def _place(scene: Scene, name: str) -> Floats:
    return scene.body(name)[0]
