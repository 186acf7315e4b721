"""CellBuildGate: all arms take their parts, and set them up one after the other."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.grasps import PLACE_YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.build_gate import PARTS, PLACES

HOLDS = {
    "east": cube_holds("pillar_east", up=0.01),
    "west": cube_holds("pillar_west", up=0.01),
    "north": cube_holds("cap"),
}


def build_gate(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that build the gate.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "building the gate", *PARTS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, height) for height in (0.11, 0.09, 0.12)],
        as_declared=True,
    )


def _script(task: TaskEnv, height: float) -> Script:
    before = dict(pairwise(reversed(PARTS)))  # by arm, whose part is set up before its own
    return {
        arm: carry(
            task,
            arm,
            part,
            HOLDS.get(arm, _beam),
            partial(_place, arm=arm),
            height=height,
            yaws=(0.0,) if part == "beam" else PLACE_YAWS,
            turn_of=[f"{before[arm]}.retreat {PARTS[before[arm]]}"] if arm in before else [],
        )
        for arm, part in PARTS.items()
    }


def _beam(scene: Scene) -> list[Pose]:
    """The gripper straight down over the beam's middle, either way round."""
    position, quaternion = scene.body("beam")
    along = yaw_of(quaternion)
    return [(position, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]


def _place(scene: Scene, arm: str) -> Floats:
    return np.array(PLACES[arm])
