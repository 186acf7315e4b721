"""CellServe: the waiter carries the can to the hatch, the server to its place; the ringer rings."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, stand_back
from robot_layouts.experts.cells.tips import press_down
from robot_layouts.experts.grasps import YAWS, need_fingers, thing_grips
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.serve import CellServe


def serve(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that serve the can.

    Raises:
        TaskError: If an arm that carries has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "serving the can", "waiter", "server")
    return first_success(
        task, seed, lambda scene: [_script(task, lean) for lean in (0.1, 0.6)], as_declared=True
    )


def _script(task: TaskEnv, lean: float) -> Script:
    grips = thing_grips(CellServe.can.descriptor, "can", 0.08, lean=lean)
    point = np.array(CellServe.bell.descriptor.points["top"].position)

    def mark(scene: Scene, name: str) -> Floats:
        return scene.body(name)[0] * (1.0, 1.0, 0.0)

    def top(scene: Scene) -> Floats:
        return scene.body("bell")[0] + point

    handing = partial(carry, task, body="can", grips=grips, height=0.1, yaws=YAWS, around=0.01)
    return {
        "waiter": handing("waiter", place=partial(mark, name="hatch"), turn_of=["server.wait"]),
        "server": (
            stand_back(task, "server"),
            *handing("server", place=partial(mark, name="place"), taking=["waiter.retreat can"]),
        ),
        "ringer": press_down(task, "ringer", "bell", top, 0.02, after=["server.release can"]),
    }
