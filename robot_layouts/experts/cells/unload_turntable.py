"""CellUnloadTurntable: every arm waits where its cube comes by, and closes on it as it passes."""

from __future__ import annotations

from functools import partial
from math import remainder, tau

import numpy as np

from robot_layouts.experts.cells.moves import TILTS, carry
from robot_layouts.experts.geometry import backed_off, heading, turn
from robot_layouts.experts.grasps import cube_grips, in_reach, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply, rotate
from tasks import TaskEnv
from tasks.cells.unload_turntable import DECAY

OVER = 0.08  # of a hand that waits above the cube's way (m)
DOWN, CLOSING = 0.9, 0.5  # how long it takes to come down, and to close (s)
IN = np.array([0.0, 0.0, 0.06])  # where a cube is let go, from its box (m)


def unload_turntable(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that take the cubes off the table.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "unloading the turntable", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, down) for down in (DOWN, 0.8 * DOWN, 1.2 * DOWN)],
        as_declared=True,
    )


def _script(task: TaskEnv, down: float) -> Script:
    return {arm: _taking(task, arm, f"cube_{arm}", down) for arm in task.layout.arms}


def _taking(task: TaskEnv, arm: str, cube: str, down: float) -> tuple[Waypoint, ...]:
    def place(scene: Scene) -> Floats:
        return scene.body(f"box_{arm}")[0] + IN

    def left(scene: Scene) -> float:
        """How long it is until the cube comes by (s)."""
        base, middle = scene.base(arm), scene.body("turntable")[0]
        off = heading(middle, base) - heading(middle, scene.body(cube)[0])
        speed = _speed(scene)
        return remainder(off, tau) / speed if speed else np.inf

    def grips(scene: Scene, ahead: float) -> list[Pose]:
        then = _later(scene, cube, ahead)
        return [grip for tilt in TILTS for grip in cube_grips(then, tilt=tilt)]

    def waiting(scene: Scene) -> list[Pose]:
        return [backed_off(grip, OVER) for grip in reached(scene)]

    reached = in_reach(task, arm, lambda scene: grips(scene, left(scene)), above=OVER)
    _, _, _, *others = carry(task, arm, cube, lambda scene: [], place, back=0.05)
    return (
        Waypoint(
            f"above {cube}", waiting, OPEN, near=0.03, until=lambda scene: left(scene) <= down
        ),
        Waypoint(f"around {cube}", partial(grips, ahead=down), OPEN, near=0.06),
        Waypoint(
            f"grasp {cube}",
            partial(grips, ahead=CLOSING),
            CLOSED,
            near=0.1,
            steps=2,
            until=partial(Scene.grasps, robot=arm, body=cube),
        ),
        *others,
    )


def _speed(scene: Scene) -> float:
    return -scene.joints("turntable")["plate"] / DECAY


def _later(scene: Scene, cube: str, ahead: float) -> Pose:
    """Where the table will have brought a cube in so long a time (s)."""
    middle, by = scene.body("turntable")[0], turn("z", ahead * _speed(scene))
    place, quaternion = scene.body(cube)
    return middle + rotate(by, place - middle), multiply(by, quaternion)
