"""CellRunPlant: one arm presses and stays, the others sweep and push their controls on."""

from __future__ import annotations

from functools import partial

import numpy as np

from robot_layouts.experts.cells.tips import advance, press_down, sweep
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv

THROW = (-1.4, 0.4, 0.12)  # of a tip about a lever: from, to (rad from upright), and how far (m)
TURN = (-0.7, 1.45, 0.06)  # about a tap: from, to (rad from its handle), and how far (m)
PIVOT, HANDLE, WIDE, NARROWS = 0.07, 0.168, 0.08, 0.32  # heights; see throw_levers (m)
CAP, TOP, SLID = (-0.19, 0.0, 0.069), (0.0, 0.0, 0.052), 0.14  # m


def run_plant(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that switch all controls on."""
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, depth) for depth in (0.02, 0.03, 0.045)],
        as_declared=True,
    )


def _script(task: TaskEnv, depth: float) -> Script:
    top, cap, along = partial(_on, "button", TOP), partial(_on, "slider", CAP), _along
    return {
        "holder": press_down(task, "holder", "button", top, depth),
        "thrower": sweep(task, "thrower", "lever", _throwing),
        "turner": sweep(task, "turner", "tap", _turning),
        "pusher": advance(task, "pusher", "slider", cap, along, _left),
    }


def _on(body: str, point: tuple[float, float, float], scene: Scene) -> Floats:
    place, quaternion = scene.body(body)
    return place + rotate(quaternion, np.array(point))


def _along(scene: Scene) -> Floats:
    return rotate(scene.body("slider")[1], np.array([1.0, 0.0, 0.0]))


def _left(scene: Scene) -> float:
    return SLID - scene.joints("slider")["cap"]


def _throwing(scene: Scene, share: float) -> Floats:
    first, last, end = THROW
    angle, radius = first + share * (last - first), end + max(0.0, WIDE - share * NARROWS)
    return _on("lever", (radius * np.sin(angle), 0.0, PIVOT + radius * np.cos(angle)), scene)


def _turning(scene: Scene, share: float) -> Floats:
    first, last, radius = TURN
    angle = first + share * (last - first)
    return _on("tap", (radius * np.cos(angle), radius * np.sin(angle), HANDLE), scene)
