"""CellCrossOver: in each pair one arm goes across and comes back, then the other."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.cross_over import HALF

ASIDE = np.array([0.32, 0.18, 0.35])  # where an arm waits, outward, ahead and up of its base (m)
FIRST, SECOND = ("southwest", "northeast"), ("southeast", "northwest")  # of each pair


def cross_over(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that bring the cubes across.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "crossing over", *FIRST, *SECOND)
    turns = ((FIRST, SECOND), (SECOND, FIRST))
    return first_success(
        task, seed, lambda scene: [_script(task, *turn) for turn in turns], as_declared=True
    )


def _script(task: TaskEnv, first: tuple[str, ...], second: tuple[str, ...]) -> Script:
    script = dict[str, tuple[Waypoint, ...]]()
    for one, other in zip(first, second, strict=True):
        script[one] = (*_carry(task, one, f"{other}.wait"), _stand_aside(task, one, "back"))
        script[other] = (_stand_aside(task, other, "wait"), *_carry(task, other, f"{one}.back"))
    return script


def _carry(task: TaskEnv, arm: str, after: str) -> tuple[Waypoint, ...]:
    return carry(
        task,
        arm,
        f"cube_{arm}",
        cube_holds(f"cube_{arm}"),
        partial(_mark, arm=arm),
        height=0.1,
        back=0.1,
        yaws=YAWS,
        taking=[after],
    )


def _stand_aside(task: TaskEnv, arm: str, name: str) -> Waypoint:
    def place(scene: Scene) -> Floats:
        base = scene.base(arm)
        return base + ASIDE * np.sign([base[0], -base[1], 1.0])

    return reaching(task, arm, name, place, near=0.1)


def _mark(scene: Scene, arm: str) -> Floats:
    return np.array([*scene.body(f"mark_{arm}")[0][:2], HALF])
