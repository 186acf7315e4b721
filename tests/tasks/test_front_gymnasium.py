"""Tasks behind Gymnasium's interface."""

import copy
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tasks
from robots import TaskError, UnknownNameError
from tasks.interfaces.gymnasium import GymnasiumTask
from tasks.registry import CATALOGUE
from tests.quick import quick_cases

CONTACT = 8  # steps
HARMLESS = (
    "A Box observation space m",  # "minimum value is -infinity", as a state's bounds are
    "For Box action spaces, we recommend using a symmetric and normalized space",
)


@pytest.mark.parametrize("task_id", quick_cases(tasks.list_tasks()))
def test_gymnasiums_own_checks(task_id):
    env = gymnasium.make(f"RobotLayouts/{task_id}")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env.unwrapped, skip_render_check=True)
    said = [str(w.message) for w in caught]
    assert [text for text in said if not any(word in text for word in HARMLESS)] == []
    env.close()


@pytest.mark.parametrize("obs_mode", ["state", "state_dict"])
def test_it_gives_what_the_task_gives(obs_mode):
    env = gymnasium.make("RobotLayouts/TwoRobotPickCube-v1", obs_mode=obs_mode)
    task = tasks.make("TwoRobotPickCube-v1", obs_mode=obs_mode)
    expect_same(env.reset(seed=5), task.reset(seed=5))
    env.action_space.seed(0)
    for _ in range(CONTACT):
        action = env.action_space.sample()
        obs, reward, terminated, truncated, info = env.step(action)
        ours = task.step(action)
        expect_same((obs, info), (ours[0], ours[4]))
        assert (reward, terminated, truncated) == tuple(x[0].item() for x in ours[1:4])
        assert [type(x) for x in (reward, terminated, truncated)] == [float, bool, bool]
        assert env.observation_space.contains(obs)


def test_observing_nothing():
    env = gymnasium.make("RobotLayouts/PickCube-v1", obs_mode="none")
    obs, info = env.reset(seed=0)
    assert obs.shape == env.observation_space.shape == (0,)
    assert info["success"] is False


def expect_same(theirs, ours):
    (obs, info), (batch, batch_info) = theirs, ours
    assert leaves(obs) == leaves(batch, 0)
    own = {key: value for key, value in batch_info.items() if key != "reconfigure"}
    assert set(info) == {*own, "is_success", "seed"}
    assert all(info[k] == np.asarray(v).reshape(-1)[0] for k, v in own.items())


def leaves(tree, row=None):
    if isinstance(tree, dict):
        return {key: leaves(part, row) for key, part in tree.items()}
    return np.asarray(tree if row is None else tree[row], np.float32).tolist()


@pytest.mark.parametrize(
    ("how", "steps"),
    [
        ({}, 50),
        ({"max_episode_steps": 20}, 20),
        ({"max_episode_steps": 60}, 60),
        ({"max_episode_steps": -1}, None),
    ],
)
def test_an_episode_is_truncated_when_its_spec_says(how, steps):
    env = gymnasium.make("RobotLayouts/PushCube-v1", **how)
    assert env.spec.max_episode_steps == steps
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    ends = [env.step(still)[3] for _ in range(61)]
    assert ends.index(True) + 1 == steps if steps else not any(ends)


@pytest.mark.parametrize("vector", [{"num_workers": 0}, {"vectorization_mode": "sync"}])
@pytest.mark.parametrize(("how", "steps"), [({}, 50), ({"max_episode_steps": 60}, 60)])
def test_so_is_one_of_a_vector(vector, how, steps):
    env = gymnasium.make_vec("RobotLayouts/PushCube-v1", num_envs=2, **vector, **how)
    assert env.spec.max_episode_steps == steps
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    ends = [env.step(still)[3].tolist() for _ in range(steps)]
    assert ends == [[False] * 2] * (steps - 1) + [[True] * 2]


def test_every_spec_says_how_long_episodes_are():
    for task_id in tasks.list_tasks():
        spec = gymnasium.spec(f"RobotLayouts/{task_id}")
        assert spec.max_episode_steps == tasks.get_task_class(task_id).max_episode_steps
        assert copy.deepcopy(spec) == spec


def test_the_time_limit_is_gymnasiums():
    with pytest.raises(TaskError, match="time limits are gymnasium.make's"):
        GymnasiumTask("PickCube-v1", max_episode_steps=20)


def test_ids_follow_the_list_of_tasks():
    known = {name for name in gymnasium.registry if name.startswith("RobotLayouts/")}
    assert {f"RobotLayouts/{task_id}" for task_id in CATALOGUE} <= known


def test_a_wrong_name_or_number_of_environments():
    with pytest.raises(gymnasium.error.NameNotFound, match="Did you mean: `PickCube`"):
        gymnasium.make("RobotLayouts/PickCub-v1")
    with pytest.raises(TaskError, match="make_vec takes num_envs"):
        gymnasium.make("RobotLayouts/PickCube-v1", num_envs=2)
    with pytest.raises(UnknownNameError, match="Did you mean 'obs_mode'"):
        gymnasium.make("RobotLayouts/PickCube-v1", obs_mod="state")


def test_importing_tasks_registers_them_without_torch_or_sapien():
    code = (
        "import sys, tasks, gymnasium; dir(tasks);"
        "print([m for m in ('torch', 'sapien', 'pettingzoo') if m in sys.modules],"
        " gymnasium.spec('RobotLayouts/PickCube-v1').id)"
    )
    assert run_python(code) == "[] RobotLayouts/PickCube-v1"


@pytest.mark.long
def test_a_task_of_ones_own_is_known_to_gymnasium():
    code = """
import gymnasium, tasks
from tasks.maniskill.pick_cube import PickCube

@tasks.register_task("Mine-v3")
class Mine(PickCube):
    pass

@tasks.register_task("no gymnasium id")
class Other(PickCube):
    pass

print(type(gymnasium.make("RobotLayouts/Mine-v3").unwrapped.task.task).__name__)
"""
    assert run_python(code) == "Mine"


def run_python(code):
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
