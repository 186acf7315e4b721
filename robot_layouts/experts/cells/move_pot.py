"""CellMovePot: one tip pushes the block away; the others raise the pot, carry it and let go."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from robot_layouts.experts.cells.moves import lift_together, set_down, stand_back
from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.grasps import in_reach, need_fingers, thing_grips
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Pose, Scene, Script
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.move_pot import CellMovePot

NARROW = -0.2  # action number of a gripper that fits between a handle and the pot
HANDLES = {"west": "left handle", "east": "right handle"}
HEIGHT, MOVES = 0.1, 8  # by which it is raised (m); steps of the way over


def move_pot(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that move the pot.

    Raises:
        TaskError: If a lifter has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "moving the pot", *HANDLES)
    return first_success(
        task, seed, lambda scene: [_script(task, strokes) for strokes in (12, 18)], as_declared=True
    )


def _script(task: TaskEnv, strokes: int) -> Script:
    def corner(scene: Scene) -> Floats:
        return scene.body("corner")[0]

    pot = CellMovePot.pot.descriptor
    grips = {
        arm: in_reach(
            task,
            arm,
            thing_grips(
                replace(pot, grasps=tuple(g for g in pot.grasps if g.part == part)), "pot", 0.08
            ),
        )
        for arm, part in HANDLES.items()
    }
    lifting = lift_together(
        "pot",
        grips,
        HEIGHT,
        onward=[*(partial(_nearer, left=MOVES - i) for i in range(MOVES)), _down],
        turn_of=["north.wait"],
        ready=0.03,
        around=0.01,
        opening=NARROW,
    )
    letting_go = set_down("pot", list(HANDLES), f"move {MOVES}", opening=NARROW)
    north = (*push(task, "north", "block", corner, strokes=strokes), stand_back(task, "north"))
    return {"north": north, **{arm: (*lifting[arm], *letting_go[arm]) for arm in HANDLES}}


def _nearer(scene: Scene, left: int) -> Pose:
    """Return the pot's next pose on its way over the mark, turned as it is."""
    position, quaternion = scene.body("pot")
    way = (scene.body("mark")[0] - position) * (1.0, 1.0, 0.0)
    return position + way / left, quaternion


def _down(scene: Scene) -> Pose:
    position, quaternion = scene.body("pot")
    return position * (1.0, 1.0, 0.0), quaternion
