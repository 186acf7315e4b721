"""CellUnlock: the holder pushes the bolt out and stays, then the lever is thrown, then pressed."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import advance, press_down, sweep
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.unlock import CellUnlock

BEHIND = (0.085, 0.0, 0.118)  # where the holder's tip begins, between lever and bolt (m)
OUT = 0.057  # how far it pushes the bolt (m)
PIVOT, FIRST, LAST = 0.052, -1.3, 0.45  # of the lever (m), and of the tip about it (rad)
WIDE, NARROWS = 0.08, 0.32  # by which its way is wider at first, and how fast that goes (m)


def unlock(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that draw the bolt, throw the lever and press."""
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, *tried) for tried in ((0.02, 12), (0.04, 12), (0.04, 6))],
        as_declared=True,
    )


def _script(task: TaskEnv, depth: float, strokes: int) -> Script:
    point = np.array(CellUnlock.button.descriptor.points["top"].position)
    draw = advance(task, "holder", "lock", partial(_on, BEHIND), _out, _left, strokes=strokes)[:-1]
    throw = sweep(task, "thrower", "lock", _throwing, after=[f"holder.{draw[-1].name}"])
    return {
        "holder": draw,
        "thrower": throw,
        "presser": press_down(
            task,
            "presser",
            "button",
            lambda scene: scene.body("button")[0] + point,
            depth,
            after=[f"thrower.{throw[-1].name}"],
        ),
    }


def _on(point: tuple[float, float, float], scene: Scene) -> Floats:
    place, quaternion = scene.body("lock")
    return place + rotate(quaternion, np.array(point))


def _out(scene: Scene) -> Floats:
    return rotate(scene.body("lock")[1], np.array([1.0, 0.0, 0.0]))


def _left(scene: Scene) -> float:
    return OUT - scene.joints("lock")["bolt"]


def _throwing(scene: Scene, share: float) -> Floats:
    angle, radius = FIRST + share * (LAST - FIRST), 0.1 + max(0.0, WIDE - share * NARROWS)
    return _on((radius * np.sin(angle), 0.0, PIVOT + radius * np.cos(angle)), scene)
