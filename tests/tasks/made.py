"""Two environments of a task, made from its class alone."""

import numpy as np

from tasks.maniskill.pick_cube import PickCube

STILL = np.zeros((2, 8), np.float32)


def make(cls=PickCube, **fields):
    scenario = cls.scenario
    for name, value in {"num_envs": 2, **fields}.items():
        setattr(scenario, name, value)
    env = cls(scenario)
    env.reset(seed=0)
    return env
