"""CellLiftPot: each arm takes the handle on its side, and both raise the pot."""

from __future__ import annotations

from dataclasses import replace

from robot_layouts.experts.cells.moves import lift_together
from robot_layouts.experts.grasps import in_reach, need_fingers, thing_grips
from robot_layouts.experts.rehearsal import Plan, first_success
from tasks import TaskEnv
from tasks.cells.lift_pot import HEIGHT, CellLiftPot

NARROW = -0.2  # action number of a gripper that fits between a handle and the pot
HANDLES = {"left": "left handle", "right": "right handle"}


def lift_pot(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of both arms, (T, A), that lift the pot.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "lifting the pot", *HANDLES)
    pot = CellLiftPot.pot.descriptor
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
    return first_success(
        task,
        seed,
        lambda scene: [
            lift_together(
                "pot", grips, HEIGHT + 0.02, legs=legs, ready=0.03, around=0.01, opening=NARROW
            )
            for legs in (4, 8)
        ],
        as_declared=True,
    )
