"""CellOpenBox: a tip presses the lever down and stays, two let their cubes in, it goes back up."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.cells.tips import HIGH, sweep
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.open_box import MOST, OPENED, PACKERS, STEEP, CellOpenBox

RADIUS, ABOVE = 0.095, 0.2  # of the tip about the hinge (m), and over the lever at first (rad)
LIFTED = OPENED + 0.05  # of the lid, before cubes come (rad)
PLACES = {"left": (0.04, -0.05, 0.13), "right": (0.04, 0.05, 0.13)}  # in the box's frame (m)


def open_box(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that fill the box.

    Raises:
        TaskError: If a packer has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "filling the box", *PACKERS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, until: str) -> Script:
    *sweeps, last = sweep(task, "opener", "box", _pressing, count=6)
    last = replace(last, near=pi, until=lambda scene: scene.joints("box")["lid"] > LIFTED)
    turns = {"right": f"opener.{last.name}", "left": f"right.{until} cube_right"}
    packing = {
        arm: carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_on, PLACES[arm]),
            height=0.12,
            back=0.3,
            turn_of=[turn],
        )
        for arm, turn in turns.items()
    }
    leaving = reaching(
        task,
        "opener",
        "leave",
        lambda scene: scene.tcp("opener")[0] + (0.0, 0.0, HIGH),
        gripper=CLOSED,
        after=("left.retreat cube_left",),
    )
    return {"opener": (*sweeps, last, leaving), **packing}


def _on(point: tuple[float, float, float], scene: Scene) -> Floats:
    place, quaternion = scene.body("box")
    return place + rotate(quaternion, np.array(point))


def _pressing(scene: Scene, share: float) -> Floats:
    x, _, z = CellOpenBox.box.descriptor.joints[0].at
    angle = STEEP + ABOVE - share * (MOST + ABOVE)
    return _on((x - RADIUS * np.cos(angle), 0.0, z + RADIUS * np.sin(angle)), scene)
