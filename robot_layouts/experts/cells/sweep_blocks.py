"""CellSweepBlocks: two arms take their brooms and sweep ahead, the others push their blocks."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.geometry import gripper_facing, heading, turn, yaw_of
from robot_layouts.experts.grasps import bringing, need_fingers, pick
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.sweep_blocks import HEAD, PUSHERS, STICK, SWEEPERS

UP = 0.004  # of a broom that sweeps, over the table (m)
FIRST, LAST = 0.42, 0.19  # of its head from the middle (m)


def sweep_blocks(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that bring the blocks onto the mark.

    Raises:
        TaskError: If a sweeper has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "sweeping", *SWEEPERS)
    return first_success(
        task, seed, lambda scene: [_script(task, count) for count in (8, 14)], as_declared=True
    )


def _script(task: TaskEnv, count: int) -> Script:
    def mark(scene: Scene, arm: str) -> Floats:
        way = scene.base(arm) * (1.0, 1.0, 0.0)
        return 0.16 * way / np.linalg.norm(way)

    return {
        **{arm: _sweep(arm, count) for arm in SWEEPERS},
        **{
            arm: push(task, arm, f"block_{arm}", partial(mark, arm=arm), strokes=count)
            for arm in PUSHERS
        },
    }


def _sweep(arm: str, count: int) -> tuple[Waypoint, ...]:
    broom = f"broom_{arm}"

    def grips(scene: Scene) -> list[Pose]:
        """Straight down over the stick, the fingers before and behind it."""
        position, quaternion = scene.body(broom)
        place, along = position + (0.0, 0.0, HEAD[2] + STICK[2] + 0.01), yaw_of(quaternion)
        return [(place, gripper_facing(along + side * pi / 2, 0.0)) for side in (-1, 1)]

    def swept(scene: Scene, share: float) -> list[Pose]:
        towards, out = heading(np.zeros(3), scene.base(arm)), FIRST + share * (LAST - FIRST)
        place = np.array([out * np.cos(towards), out * np.sin(towards), HEAD[2] + UP])
        return [bringing(scene, arm, broom, (place, turn("z", towards)))]

    return (
        *pick(arm, broom, grips, ready=0.03, above=0.08),
        *(
            Waypoint(f"sweep {i}", partial(swept, share=i / count), CLOSED, near=0.04)
            for i in range(count + 1)
        ),
    )
