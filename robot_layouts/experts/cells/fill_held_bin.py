"""CellFillHeldBin: the holder raises the bin, then two let their cubes in by turns."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, lift_together
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.fill_held_bin import FILLERS, GRIP, HEIGHT

LEGS, RAISED = 3, HEIGHT + 0.04  # steps up, and how far (m)
PLACES = {"left": (-0.02, -0.035, 0.095), "right": (-0.02, 0.035, 0.095)}  # in the bin's frame (m)


def fill_held_bin(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that fill the bin in the air.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "filling the bin", "holder", *FILLERS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, until: str) -> Script:
    turns = {"right": f"holder.raise {LEGS - 1}", "left": f"right.{until} cube_right"}
    filling = {
        arm: carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_inside, arm=arm),
            height=0.1,
            turn_of=[turn],
        )
        for arm, turn in turns.items()
    }
    lifting = lift_together("bin", {"holder": _grips}, RAISED, legs=LEGS, ready=0.03, around=0.01)
    return {**lifting, **filling}


def _grips(scene: Scene) -> list[Pose]:
    """The gripper straight down over the handle, its fingers on the handle's long sides."""
    position, quaternion = scene.body("bin")
    place, along = position + rotate(quaternion, np.array(GRIP)), yaw_of(quaternion)
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]


def _inside(scene: Scene, arm: str) -> Floats:
    (x, y, z), quaternion = scene.body("bin")
    raised = np.array([x, y, max(z, RAISED)])
    return raised + rotate(quaternion, np.array(PLACES[arm]))
