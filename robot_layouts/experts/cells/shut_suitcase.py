"""CellShutSuitcase: a tip sweeps the lid over, then two push the latches home at once."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import advance, sweep
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.shut_suitcase import SHUT, TABS, TRAVEL

HINGE, RADIUS = (-0.1, 0.092), 0.19  # of the lid, x and z, and of the tip about it (m)
FIRST, LAST = 2.45, 1.35  # rad; of the tip about it, from behind the lid to over the case
GAP = 0.06  # between a tip and its latch when it comes down (m)


def shut_suitcase(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that shut and latch the suitcase."""
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, *tried) for tried in ((RADIUS, 10), (RADIUS - 0.02, 14))],
        as_declared=True,
    )


def _script(task: TaskEnv, radius: float, strokes: int) -> Script:
    *sweeps, last = sweep(task, "closer", "case", partial(_over, radius), count=8)
    last = replace(last, until=lambda scene: scene.joints("case")["lid"] < SHUT / 2)
    return {
        "closer": (*sweeps, last),
        **{
            arm: advance(
                task,
                arm,
                "case",
                partial(_on, np.add(tab, (TRAVEL + GAP, 0.0, 0.0))),
                _inward,
                partial(_left, side),
                strokes=strokes,
                after=[f"closer.{last.name}"],
            )
            for arm, (side, tab) in TABS.items()
        },
    }


def _on(point: Floats, scene: Scene) -> Floats:
    place, quaternion = scene.body("case")
    return place + rotate(quaternion, point)


def _over(radius: float, scene: Scene, share: float) -> Floats:
    angle, (x, z) = FIRST + share * (LAST - FIRST), HINGE
    return _on(np.array([x + radius * np.cos(angle), 0.0, z + radius * np.sin(angle)]), scene)


def _inward(scene: Scene) -> Floats:
    return rotate(scene.body("case")[1], np.array([-1.0, 0.0, 0.0]))


def _left(side: str, scene: Scene) -> float:
    return scene.joints("case")[side]
