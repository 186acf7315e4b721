"""Tasks compute the same on torch tensors as on NumPy's arrays, and turn neither into the other."""

from copy import deepcopy

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation import State
from tasks.language.stages import PassedStages

STEPS, ENVS = 12, 3


class Refusing(torch.Tensor):
    """A tensor that cannot become an array, as if it were on another device."""

    def numpy(self, *_, **__):
        raise AssertionError("a task turned a tensor into an array")

    __array__ = numpy


def on_tensors(value):
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value.copy()).as_subclass(Refusing)
    if isinstance(value, tuple):
        return tuple(map(on_tensors, value))
    if isinstance(value, dict):
        return {key: on_tensors(part) for key, part in value.items()}
    return value


class TensorState(State):
    """A state whose every array is a tensor that refuses to become NumPy's."""

    def __init__(self, state):
        self._state = state
        self.num_envs = state.num_envs

    def __getattribute__(self, name):
        if name in ("_state", "num_envs"):
            return object.__getattribute__(self, name)
        if name in ("array", "doubles", "full", "among", "env_ids"):
            return State.__dict__[name].__get__(self)
        found = getattr(object.__getattribute__(self, "_state"), name)
        if not callable(found):
            return on_tensors(found)
        return lambda *args, **kwargs: on_tensors(found(*args, **kwargs))


def outcome(task, state, action, memory):
    """Return what a task says of a state, and the memory that it leaves."""
    task.memory = memory
    info = dict(task.evaluate(state))
    if task.stages:  # the engine's part of info, which a reward may take
        flags = {name: np.asarray(torch.Tensor(info[name]).bool()) for name in task.stages}
        told = PassedStages(task.stages, ENVS).told(flags)["stage_score"]
        info["stage_score"] = told if isinstance(state.full(0.0), np.ndarray) else on_tensors(told)
    said = {"info": info, "observation": dict(task.observe(state, info))}
    if "dense" in task.reward_modes:
        said["reward"] = task.dense_reward(state, action, info)
    said["memory"] = dict(vars(task.memory))
    return said


def leaves(tree):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from ((f"{key}/{name}", leaf) for name, leaf in leaves(value))
        else:
            yield key, value


FETCH = [(task_id, "fetch_driving") for task_id in ("PickCube-v1", "PokeCube-v1")]


@pytest.mark.parametrize(
    ("task_id", "robot"), [*((task_id, None) for task_id in tasks.list_tasks()), *FETCH]
)
def test_a_task_computes_the_same_on_tensors(task_id, robot):
    env = tasks.make(task_id, num_envs=ENVS, robots=robot)
    rng = np.random.RandomState(0)
    space = env.single_action_space
    obs, _ = env.reset(seed=3)
    for _ in range(STEPS):
        action = rng.uniform(space.low, space.high, (ENVS, *space.shape)).astype(np.float32)
        env.step(action)
        state, memory = env._state, env.task.memory
        remembered = type(memory)(**{key: on_tensors(rows) for key, rows in vars(memory).items()})
        task, acting = env.task, on_tensors(action)
        tensors = dict(leaves(outcome(task, TensorState(state), acting, remembered)))
        arrays = dict(leaves(outcome(task, state, action, deepcopy(memory))))
        task.memory = memory
        assert tensors.keys() == arrays.keys()
        for name, tensor in tensors.items():
            assert isinstance(tensor, Refusing), name
            np.testing.assert_array_equal(tensor.as_subclass(torch.Tensor).numpy(), arrays[name])
        fresh = env.remember(TensorState(state))
        for name, rows in env.remember(state).items():
            plain = fresh[name].as_subclass(torch.Tensor).numpy()
            np.testing.assert_array_equal(plain, rows)
            assert plain.dtype == rows.dtype
    env.close()
