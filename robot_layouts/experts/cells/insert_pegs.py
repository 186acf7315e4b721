"""CellInsertPegs: the holder raises the yoke, then each of the others lowers its peg into it."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, lift_together
from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import QUARTERS, bringing, cube_grips, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.insert_pegs import DEEP, HEIGHT, HELD, SIDES, TALL

LEGS, RAISED = 3, HEIGHT + 0.03  # steps up, and how far (m)
UP = 0.02  # m; how far above its middle a peg is held
LET_GO = DEEP + TALL - 0.015  # of a peg's middle in the yoke when it is let go (m)
HEIGHTS = (0.06, 0.02, 0.01, 0.0)  # of a peg over that, one after the other (m)
FORWARD, OPENING = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
EXACT = 0.002  # rad; so near an arm comes to its place over the socket


def insert_pegs(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that insert the pegs.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "inserting pegs", "holder", *SIDES)
    up = f"holder.raise {LEGS - 1}"
    tries = ({"left": up, "right": up}, {"right": up, "left": "right.retreat peg_right"})
    return first_success(
        task, seed, lambda scene: [_script(task, turns) for turns in tries], as_declared=True
    )


def _script(task: TaskEnv, turns: dict[str, str]) -> Script:
    """Return a script by what each arm waits for before it brings its peg."""
    lifting = lift_together("yoke", {"holder": _grips}, RAISED, legs=LEGS, ready=0.03, around=0.01)
    return {**lifting, **{arm: _inserting(task, arm, after) for arm, after in turns.items()}}


def _inserting(task: TaskEnv, arm: str, after: str) -> list[Waypoint]:
    peg = f"peg_{arm}"
    steps = carry(
        task,
        arm,
        peg,
        partial(_straight, peg=peg),
        partial(_into, arm=arm),
        height=0.08,
        drop=0.0,
        around=0.01,
    )
    over, lower = (
        [waypoint.name for waypoint in steps].index(f"{word} {peg}") for word in ("over", "lower")
    )

    def upright(scene: Scene, up: float) -> list[Pose]:
        """The peg over its socket, the hand with its narrow side to the holder's arm."""
        quaternion = scene.body("yoke")[1]
        at, across = _into(scene, arm) + (0.0, 0.0, up), rotate(quaternion, FORWARD)
        turned = [turn("z", yaw_of(quaternion) + quarter * pi / 2) for quarter in QUARTERS]
        poses = [bringing(scene, arm, peg, (at, each)) for each in turned]
        return [pose for pose in poses if abs(rotate(pose[1], OPENING) @ across) > 0.5]

    exactly = [
        Waypoint(
            f"down {peg} {i}",
            partial(upright, up=height),
            CLOSED,
            near=EXACT,
            after=() if i else (after,),
        )
        for i, height in enumerate(HEIGHTS)
    ]
    return [*steps[:over], *exactly, *steps[lower + 1 :]]


def _grips(scene: Scene) -> list[Pose]:
    """The gripper straight down over the yoke's middle, its fingers on the long sides."""
    position, quaternion = scene.body("yoke")
    place, along = position + (0.0, 0.0, HELD), yaw_of(quaternion)
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (pi / 2, -pi / 2)]


def _straight(scene: Scene, peg: str) -> list[Pose]:
    """The grips of a peg straight from above."""
    position, quaternion = scene.body(peg)
    return cube_grips((position + (0.0, 0.0, UP), quaternion))


def _into(scene: Scene, arm: str) -> Floats:
    position, quaternion = scene.body("yoke")
    return position + rotate(quaternion, np.array([0.0, SIDES[arm], LET_GO]))
