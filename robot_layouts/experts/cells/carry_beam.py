"""CellCarryBeam: one arm takes the cube away; the others raise the beam, carry it and let go."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, lift_together, set_down
from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.carry_beam import HALF, LIFTERS, PLACE

ENDS = {"west": -0.21, "east": 0.21}  # where the beam is held, along it (m)
HEIGHT, MOVES = 0.14, 6  # by which it is raised (m); steps of the way over


def carry_beam(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that lay the beam on the rests.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "carrying the beam", "north", *LIFTERS)
    return first_success(
        task, seed, lambda scene: [_script(task, near) for near in (0.04, 0.02)], as_declared=True
    )


def _script(task: TaskEnv, near: float) -> Script:
    def mark(scene: Scene) -> Floats:
        return np.array([*scene.body("mark")[0][:2], HALF])

    over = [partial(_nearer, left=MOVES - i) for i in range(MOVES)]
    lifting = lift_together(
        "beam",
        {arm: partial(_grips, along=along) for arm, along in ENDS.items()},
        HEIGHT,
        onward=[*over, _down],
        turn_of=["north.retreat cube"],
        near=near,
        ready=0.03,
    )
    letting_go = set_down("beam", LIFTERS, f"move {MOVES}")
    north = carry(task, "north", "cube", cube_holds("cube"), mark, height=0.1, back=0.06, yaws=YAWS)
    return {"north": north, **{arm: (*lifting[arm], *letting_go[arm]) for arm in LIFTERS}}


def _grips(scene: Scene, along: float) -> list[Pose]:
    """Straight down over an end of the beam, the fingers on its long sides."""
    position, quaternion = scene.body("beam")
    place, yaw = position + rotate(quaternion, np.array([along, 0.0, 0.0])), yaw_of(quaternion)
    return [(place, gripper_facing(yaw + side, 0.0)) for side in (0.0, pi)]


def _nearer(scene: Scene, left: int) -> Pose:
    """Return the beam's next pose on its way over the rests, turned back to straight."""
    position, quaternion = scene.body("beam")
    way = np.array([*PLACE[:2], position[2]]) - position
    return position + way / left, turn("z", yaw_of(quaternion) * (1 - 1 / left))


def _down(scene: Scene) -> Pose:
    return np.array(PLACE) + (0.0, 0.0, 0.002), turn("z", 0.0)
