"""CellCloseDrawers: every arm goes before its handle and pushes."""

from __future__ import annotations

import numpy as np

from robot_layouts.experts.cells.moves import push_shut
from robot_layouts.experts.rehearsal import Plan, first_success
from tasks import TaskEnv
from tasks.cells.close_drawers import SIDES, CellCloseDrawers


def close_drawers(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that close the drawers."""
    handle = np.array(CellCloseDrawers.case_first.descriptor.points["handle"].position)
    return first_success(
        task,
        seed,
        lambda scene: [
            {
                arm: push_shut(task, arm, f"case_{arm}", handle=handle, height=height)
                for arm in SIDES
            }
            for height in (0.045, 0.03, 0.055)
        ],
        as_declared=True,
    )
