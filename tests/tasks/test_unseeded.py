"""Environments that nobody seeds differ, say what they began with, and can be played again."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest

import tasks
from robots import TaskError
from tasks.interfaces.vector import VectorTask

TASK = "PushCube-v1"
STILL = np.zeros(8, np.float32)


class Alone:
    """One of Gymnasium's environments."""

    def __init__(self):
        self.env = gymnasium.make(f"RobotLayouts/{TASK}", disable_env_checker=True)

    def reset(self, **arguments):
        obs, info = self.env.reset(**arguments)
        return obs, info

    def step(self):
        return self.env.step(STILL)[4]


class OneRobot(Alone):
    """One of PettingZoo's."""

    def __init__(self):
        self.env = tasks.parallel_env(TASK)

    def reset(self, **arguments):
        obs, info = self.env.reset(**arguments)
        return obs["arm"], info["arm"]

    def step(self):
        return self.env.step({"arm": STILL})[4]["arm"]


@pytest.mark.parametrize("make", [Alone, OneRobot])
def test_eight_of_them_differ_and_can_be_played_again(make):
    fronts = [make() for _ in range(8)]
    begun = [front.reset() for front in fronts]
    assert len({obs.tobytes() for obs, _ in begun}) == 8
    later = fronts[0].reset()
    assert later[1]["seed"] == begun[0][1]["seed"]  # its random streams ran on
    assert not np.array_equal(later[0], begun[0][0])
    other = fronts[1]
    for obs, info in begun:
        assert isinstance(info["seed"], int)
        np.testing.assert_array_equal(other.reset(seed=info["seed"])[0], obs)
    other.reset(seed=begun[0][1]["seed"])
    np.testing.assert_array_equal(other.reset()[0], later[0])


@pytest.mark.parametrize("make", [Alone, OneRobot])
def test_what_is_refused_leaves_it_unseeded(make):
    first, second = make(), make()
    for front in (first, second):
        with pytest.raises(TaskError, match="it must be True or False"):
            front.reset(options={"reconfigure": 1})
    assert first.reset()[1]["seed"] != second.reset()[1]["seed"]


@pytest.mark.parametrize("make", [Alone, OneRobot])
def test_info_has_the_same_keys_after_a_reset_and_a_step(make):
    front = make()
    _, begun = front.reset(seed=3, options={"reconfigure": True})
    assert list(begun) == list(front.step())
    assert begun["seed"] == 3


def test_gymnasium_knows_the_seed():
    env = gymnasium.make(f"RobotLayouts/{TASK}")
    _, info = env.reset()
    assert env.unwrapped.np_random_seed == info["seed"]


def vector(**fields):
    return VectorTask(TASK, **{"num_envs": 3, "num_workers": 0, **fields})


def test_vectors_differ_in_every_environment():
    begun = [vector().reset() for _ in range(3)]
    assert len({row.tobytes() for obs, _ in begun for row in obs}) == 9
    env = vector()
    for obs, info in begun:
        assert info["seed"].dtype == np.int64
        assert (np.diff(info["seed"]) == 1).all()
        np.testing.assert_array_equal(env.reset(seed=int(info["seed"][0]))[0], obs)


def test_workers_begin_with_the_vectors_seeds():
    with closing(vector(num_workers=2)) as env:
        obs, info = env.reset()
        np.testing.assert_array_equal(vector().reset(seed=info["seed"].tolist())[0], obs)
        assert list(env.step(np.zeros((3, 8), np.float32))[4]) == list(info)


def test_environments_of_a_vector_are_seeded_when_they_begin():
    env = vector()
    mask = np.array([False, True, False])
    _, first = env.reset(options={"reset_mask": mask})
    assert first["_seed"].tolist() == mask.tolist()
    assert first["seed"][[0, 2]].tolist() == [0, 0]
    _, second = env.reset(seed=[None, None, 5])
    assert second["seed"][1] == first["seed"][1]  # its random streams ran on
    assert second["seed"][2] == 5
    assert second["seed"][0] not in (0, 2022)


def test_an_ended_episode_keeps_its_seed_in_its_last_info():
    env = vector(autoreset_mode="SAME_STEP", max_episode_steps=2)
    env.reset(seed=7)
    env.step(np.zeros((3, 8), np.float32))
    info = env.step(np.zeros((3, 8), np.float32))[4]
    assert info["final_info"]["seed"].tolist() == info["seed"].tolist() == [7, 8, 9]


def test_the_task_itself_begins_with_natives_seeds():
    env, other = tasks.make(TASK, num_envs=2), tasks.make(TASK, num_envs=2)
    assert env.seeds == [2022, 2023]
    assert (env.reset()[0] == other.reset()[0]).all()
    assert "seed" not in env.reset()[1]
