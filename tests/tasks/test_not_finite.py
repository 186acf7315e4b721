"""NaN and numbers beyond all sense are refused where they come in, and where they come up."""

import math

import numpy as np
import pytest
import torch

from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import SimulationError, TaskError
from tasks.maniskill.pick_cube import PickCube
from tests.tasks.made import STILL, make


def spoilt(env, entry, place, value):
    group, key = entry.split("/")
    state = env.get_state_dict()
    rows = state[group][key] = state[group][key].double()
    rows[1, place] = value
    state["actors"]["goal_site"][:, 0] += 0.1  # set before or after it, had it been set
    return state


@pytest.mark.parametrize(
    ("entry", "place", "value", "message"),
    [
        ("actors/cube", 1, math.nan, "actors/cube: position y is nan for environment 1"),
        ("actors/cube", 0, 1e30, "position x is 1.* from -1e.06 to 1e.06 is needed"),
        ("actors/cube", slice(3, 7), 0.0, "quaternion .* for environment 1 is .*has length 0"),
        ("actors/cube", 8, math.inf, "linear velocity y is inf for environment 1"),
        ("articulations/panda", 14, 1e30, "qpos of panda_joint2 is .* environment 1"),
        ("articulations/panda", 13, 90.0, "qpos of panda_joint1 is 90 for environment 1"),
        ("articulations/panda", 30, math.nan, "qvel of panda_finger_joint2 is nan"),
        ("articulations/panda", 3, 2.0, "quaternion .* has length 2"),
    ],
)
def test_states_that_make_no_sense_are_refused_whole(entry, place, value, message):
    env = make()
    before = env.get_state_dict()
    with pytest.raises(TaskError, match=message):
        env.set_state_dict(spoilt(env, entry, place, value))
    for group, entries in env.get_state_dict().items():
        for key, rows in entries.items():
            assert torch.equal(rows, before[group][key])


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (5, "the state is 5; it must be a mapping"),
        ({"actors": [1]}, r"actors is \[1\]; it must be a mapping"),
        ({"actors": {"cube": None}}, "actors/cube has dtype object; it must hold numbers"),
        ({"actors": {"cube": [["a"] * 13] * 2}}, "has dtype <U1"),
        ({"actors": {"cube": torch.zeros(2, 13).to_sparse()}}, "is not an array of numbers"),
        ({"actors": {"cube": [[0.0], []]}}, "is not an array of numbers"),
    ],
)
def test_what_is_no_state_is_refused(state, message):
    with pytest.raises(TaskError, match=message):
        make().set_state_dict(state)


def test_environments_are_named_by_their_own_numbers():
    env = make()
    row = env.get_state_dict()["actors"]["cube"][:1] * math.nan
    with pytest.raises(TaskError, match="for environment 1"):
        env.set_state_dict({"actors": {"cube": row}}, env_ids=[1])


@pytest.mark.parametrize("obs_mode", ["state", "state_dict", "none"])
def test_physics_that_diverges(obs_mode):
    env, other = make(obs_mode=obs_mode), make(obs_mode=obs_mode)
    cube = worlds_below(env.simulation)[1].bodies["cube"].component
    cube.set_linear_velocity([math.nan, 0.0, 0.0])
    with pytest.raises(SimulationError, match="body 'cube' .* in environment 1 at step 1"):
        env.step(STILL)
    for each in (env, other):
        each.reset(seed=3, options={"reconfigure": True})
        each.step(STILL)
    for group, entries in env.get_state_dict().items():
        for key, rows in entries.items():
            assert torch.equal(rows, other.get_state_dict()[group][key])


@pytest.mark.parametrize("key", ["seed", "reconfigure"])
def test_info_has_names_of_its_own(key):
    def evaluate(self, state):
        return {**PickCube.evaluate(self, state), key: np.zeros(self.num_envs)}

    with pytest.raises(TaskError, match=rf"evaluate\(\) returned {key}, which info already has"):
        make(type("Taking", (PickCube,), {"evaluate": evaluate}))
