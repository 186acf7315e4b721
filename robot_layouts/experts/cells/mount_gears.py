"""CellMountGears: all arms take their gears, come over their shafts, and let go on them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry
from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import YAWS, bringing, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.mount_gears import CellMountGears

HUB = 0.02  # m; how high on a gear its hub is held
BELOW = 0.015  # m; how far below the tip of its shaft a gear is let go
HEIGHTS = (0.06, 0.03, 0.023, 0.015, 0.007, 0.0)  # of a gear over that, one after the other (m)
EXACT = 0.0015  # rad; so near an arm comes to its place over the shaft


def mount_gears(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that put the gears on their shafts.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "mounting gears", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, 0.01, [0.0]), _script(task, 0.004, YAWS)],
        as_declared=True,
    )


def _script(task: TaskEnv, around: float, turns: Sequence[float]) -> Script:
    """Return a script by how near a grip fingers close (rad), and how gears may turn (rad)."""
    return {arm: _mounting(task, arm, around, turns) for arm in task.layout.arms}


def _mounting(task: TaskEnv, arm: str, around: float, turns: Sequence[float]) -> list[Waypoint]:
    gear = f"gear_{arm}"
    place = partial(_upon, arm=arm)
    steps = carry(
        task,
        arm,
        gear,
        partial(_grips, gear=gear),
        place,
        height=HEIGHTS[0],
        drop=0.0,
        yaws=YAWS,
        around=around,
    )
    over = [waypoint.name for waypoint in steps].index(f"over {gear}") + 1

    def level(scene: Scene, up: float) -> list[Pose]:
        at, yaw = place(scene) + (0.0, 0.0, up), yaw_of(scene.body(gear)[1])
        return [bringing(scene, arm, gear, (at, turn("z", yaw + by))) for by in turns]

    exactly = [
        Waypoint(f"down {gear} {i}", partial(level, up=height), CLOSED, near=EXACT)
        for i, height in enumerate(HEIGHTS)
    ]
    return [*steps[:over], *exactly, *steps[over + 1 :]]


def _grips(scene: Scene, gear: str) -> list[Pose]:
    """Return the grips of a gear straight from above, by its hub."""
    position, quaternion = scene.body(gear)
    turns = yaw_of(quaternion) + np.arange(8) * pi / 4
    return [(position + (0.0, 0.0, HUB), gripper_facing(heading, 0.0)) for heading in turns]


def _upon(scene: Scene, arm: str) -> Floats:
    tip = np.array(CellMountGears.shaft_first.descriptor.points["tip"].position)
    return scene.body(f"shaft_{arm}")[0] + tip - (0.0, 0.0, BELOW)
