"""CellStowTwo: one presses and stays, one pulls, two let their cubes in by turns, it pushes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi

from robot_layouts.experts.cells.moves import carry, cube_holds
from robot_layouts.experts.cells.tips import press_down
from robot_layouts.experts.grasps import (
    in_reach,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    thing_grips,
)
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.stow_two import PACKERS, CellStowTwo

PULLED = 0.15  # m
OVER = {"left": (-0.06, -0.03, 0.1), "right": (0.06, -0.03, 0.1)}  # from the open drawer (m)


def stow_two(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that stow the cubes.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "stowing cubes", "opener", *PACKERS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, until) for until in ("rise", "retreat")],
        as_declared=True,
    )


def _script(task: TaskEnv, until: str) -> Script:
    turns = {"right": "opener.case.drawer 7", "left": f"right.{until} cube_right"}
    packing = {
        arm: carry(
            task,
            arm,
            f"cube_{arm}",
            cube_holds(f"cube_{arm}"),
            partial(_inside, arm=arm),
            height=0.1,
            turn_of=[turn],
        )
        for arm, turn in turns.items()
    }
    return {
        "opener": _opening(task, "left.retreat cube_left"),
        "holder": press_down(task, "holder", "button", _top, 0.03),
        **packing,
    }


def _opening(task: TaskEnv, packed: str) -> tuple[Waypoint, ...]:
    handle = thing_grips(CellStowTwo.case.descriptor, "case", 0.08, lean=pi / 2)
    return (
        *pick(
            "opener",
            "case.drawer",
            in_reach(task, "opener", handle, on=_pull),
            ready=0.03,
            around=0.01,
        ),
        *move_joint("opener", "case", "drawer", PULLED),
        *(
            replace(waypoint, name=f"shut {i}", after=() if i else (packed,))
            for i, waypoint in enumerate(move_joint("opener", "case", "drawer", 0.0))
        ),
    )


def _pull(scene: Scene, grip: Pose) -> list[Pose]:
    return [moved_along(scene, "case", "drawer", at, grip) for at in (0.05, 0.1, PULLED)]


def _top(scene: Scene) -> Floats:
    return scene.body("button")[0] + CellStowTwo.button.descriptor.points["top"].position


def _inside(scene: Scene, arm: str) -> Floats:
    return scene.part("case", "drawer", PULLED)[0] + OVER[arm]
