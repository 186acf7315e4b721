"""CellPutAndClose: the packer lets the cube into the drawer; then the closer pushes."""

from __future__ import annotations

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, push_shut
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.put_and_close import CellPutAndClose

ABOVE = 0.11  # of the drawer, where the cube is let go (m)


def put_and_close(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of both arms, (T, A), that put the cube away.

    Raises:
        TaskError: If the packer has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "packing the cube", "packer")
    handle = np.array(CellPutAndClose.case.descriptor.points["handle"].position)

    def inside(scene: Scene) -> Floats:
        return scene.body("case.drawer")[0] + np.array([0.0, 0.05, ABOVE])

    return first_success(
        task,
        seed,
        lambda scene: [
            {
                "packer": carry(task, "packer", "cube", cube_holds("cube"), inside),
                "closer": push_shut(
                    task,
                    "closer",
                    "case",
                    handle=handle,
                    height=height,
                    after=["packer.retreat cube"],
                ),
            }
            for height in (0.05, 0.035)
        ],
        as_declared=True,
    )
