"""The hand-over's plans, made once per process for all tests."""

import functools

import numpy as np

import tasks
from rollouts.experts import find_expert

TASK = "TwoRobotPickCube-v1"


@functools.cache
def task() -> tasks.MultiRobotTask:
    return tasks.make(TASK)


@functools.cache
def plan(seed: int) -> np.ndarray:
    return find_expert(TASK)(task(), seed)
