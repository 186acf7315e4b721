"""CellBuildBridge: the pillars are set up one after the other, and the beam is laid on them."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.build_bridge import TALL, TOP


def build_bridge(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that build the bridge.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "building the bridge", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, until: str) -> Script:
    right, left = f"right.{until} pillar_right", f"left.{until} pillar_left"
    pillars = {
        side: carry(
            task,
            side,
            f"pillar_{side}",
            cube_holds(f"pillar_{side}", up=0.01),
            partial(_mark, side=side),
            turn_of=[right] if side == "left" else [],
            height=0.08,
        )
        for side in ("right", "left")
    }
    beam = carry(
        task, "across", "beam", _beam, _top, yaws=(0.0,), height=0.08, turn_of=[right, left]
    )
    return {"across": beam, **pillars}


def _mark(scene: Scene, side: str) -> Floats:
    return np.array([*scene.body(f"mark_{side}")[0][:2], TALL])


def _beam(scene: Scene) -> list[Pose]:
    position, quaternion = scene.body("beam")
    along = yaw_of(quaternion)
    return [(position, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]


def _top(scene: Scene) -> Floats:
    return np.array(TOP[0])
