"""CellHammerPegs: each arm takes the mallet, presses its peg home, and puts it on the mark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

from robot_layouts.experts.cells.moves import carriable, carry, cube_holds, stand_back
from robot_layouts.experts.grasps import held_at, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.hammer_pegs import HELD, TOP, TRAVEL

OVER = 0.06  # of the mallet over a peg before it goes down (m)
STROKES, BEYOND = 6, 0.01  # in how many parts it goes down, and how far too far it aims (m)
RAISED = 0.1  # of the mallet on its way (m)


def hammer_pegs(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that drive the pegs home.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "hammering", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, beyond) for beyond in (BEYOND, 2 * BEYOND)],
        as_declared=True,
    )


def _script(task: TaskEnv, beyond: float) -> Script:
    before = {arm: [f"{other}.wait"] for other, arm in pairwise(task.layout.arms)}
    return {arm: _driving(task, arm, beyond, before.get(arm, [])) for arm in task.layout.arms}


def _driving(task: TaskEnv, arm: str, beyond: float, taking: Sequence[str]) -> list[Waypoint]:
    def peg(scene: Scene, up: float = 0.0) -> Floats:
        return scene.body(f"block_{arm}")[0] + (0.0, 0.0, TOP + up)

    def at(scene: Scene, up: float) -> list[Pose]:
        return held_at(scene, arm, "mallet", peg(scene, up))

    def mark(scene: Scene) -> Floats:
        return scene.body("mark")[0] * (1.0, 1.0, 0.0)

    grips = carriable(task, arm, "mallet", cube_holds("mallet", HELD), peg, OVER)
    steps = carry(task, arm, "mallet", grips, mark, height=RAISED, around=0.01, taking=taking)
    lift = [waypoint.name for waypoint in steps].index("lift mallet") + 1
    ends = [(TRAVEL + beyond) * (i + 1) / STROKES for i in range(STROKES)]
    aside = stand_back(task, arm)
    return [
        *([replace(aside, name="aside")] if taking else []),
        *steps[:lift],
        Waypoint("over peg", partial(at, up=OVER), CLOSED, near=0.02),
        Waypoint("on peg", partial(at, up=0.005), CLOSED, near=0.02),
        *(
            Waypoint(f"drive {i}", partial(at, up=-end), CLOSED, steps=4, near=0.1)
            for i, end in enumerate(ends)
        ),
        Waypoint("off peg", partial(at, up=OVER), CLOSED, near=0.03),
        *steps[lift:-1],
        aside,
    ]
