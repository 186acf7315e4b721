"""CellPushBar: each tip pushes its part of the bar until that is on the line."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import advance
from robot_layouts.experts.geometry import yaw_of
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.push_bar import HALF_HEIGHT, HALF_WIDTH

GAP = 0.06  # between a tip and the bar when it comes down (m)


def push_bar(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that push the bar."""

    def along(scene: Scene, body: str, arm: str) -> float:
        """Return where a body crosses the way ahead of an arm, x (m, world)."""
        place, quaternion = scene.body(body)
        aside = scene.base(arm)[1] - place[1]
        return float(place[0] - np.tan(yaw_of(quaternion)) * aside)

    def start(scene: Scene, arm: str) -> Floats:
        x = along(scene, "bar", arm) - HALF_WIDTH - GAP
        return np.array([x, scene.base(arm)[1], HALF_HEIGHT])

    def ahead(scene: Scene) -> Floats:
        return np.array([1.0, 0.0, 0.0])

    def left(scene: Scene, arm: str) -> float:
        return along(scene, "line", arm) - along(scene, "bar", arm)

    return first_success(
        task,
        seed,
        lambda scene: [
            {
                arm: advance(
                    task,
                    arm,
                    "bar",
                    partial(start, arm=arm),
                    ahead,
                    partial(left, arm=arm),
                    strokes=strokes,
                    beside=[other for other in task.layout.arms if other != arm],
                )
                for arm in task.layout.arms
            }
            for strokes in (12, 18)
        ],
        as_declared=True,
    )
