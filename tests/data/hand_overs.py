"""The hand-over's plans; see `expert_plays`."""

import numpy as np

import tasks
from tests.data import expert_plays

TASK = "TwoRobotPickCube-v1"


def task() -> tasks.MultiRobotTask:
    return expert_plays.task(TASK)


def plan(seed: int) -> np.ndarray:
    return expert_plays.plan(TASK, seed)
