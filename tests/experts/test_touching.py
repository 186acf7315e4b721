"""Arms that touch are seen where physics lets them pass through each other, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experts.touching import ArmWatch
from layouts import face_to_face
from tasks import get_task_class

HANDS = [0.0, 0.41, 0.0, -2.05, 0.0, 2.46, 0.785, 0.04, 0.04]  # in each other, 1.2 m apart


@pytest.mark.parametrize("task_id", ["TwoRobotPickCube-v1", "TwoRobotLiftBar-v1"])
def test_hands_in_each_other_are_seen_in_clones_as_in_other_tasks(task_id):
    cls = get_task_class(task_id)
    facing = face_to_face({"left": "panda", "right": "panda"}, spacing=1.2)
    task = cls(replace(cls.scenario, layout=facing, obs_mode="none", check_layout=False))
    for name in facing:
        task.simulation.worlds[0].stand(name, HANDS)
    watch = ArmWatch(task)
    task.step(np.zeros((1, 16), np.float32))
    by_physics = task.simulation.arms_touching(0)
    assert any({part.name for part in pair} == {"panda_hand"} for pair in by_physics) == (
        cls.native_id is None
    )
    task.simulation.worlds[0].stand("left", HANDS)
    task.simulation.worlds[0].stand("right", HANDS)
    task.step(np.zeros((1, 16), np.float32))
    found = watch.touching()
    assert any({part.name for part in pair} == {"panda_hand"} for pair in found)
    task.close()
