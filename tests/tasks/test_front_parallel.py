"""Tasks behind PettingZoo's interface."""

import sys

import numpy as np
import pytest

import tasks
from robots import ActionError, MissingPackageError, TaskError, UnknownNameError
from tests.quick import quick_cases

checks = pytest.importorskip("pettingzoo.test")

TWO = "TwoRobotPickCube-v1"


@pytest.fixture
def env():
    return tasks.parallel_env(TWO)


@pytest.mark.parametrize("task_id", quick_cases(tasks.list_tasks()))
# Its random actions may hit the table, which is reported.
@pytest.mark.filterwarnings("error", "ignore:robot .* is thrown about:RuntimeWarning")
def test_pettingzoos_own_checks(task_id, capsys):
    checks.parallel_api_test(tasks.parallel_env(task_id), num_cycles=20)
    checks.parallel_seed_test(lambda: tasks.parallel_env(task_id), num_cycles=5)


def test_one_agent_per_robot_with_its_own_spaces():
    env = tasks.parallel_env(TWO, robots={"right": "panda_stick"})
    assert env.possible_agents == ["left", "right"]
    assert env.action_space("left").shape == (8,)
    assert env.action_space("right").shape == (7,)
    shared = 7 + 7 + 7 + 3 + 3 + 3  # TCPs, cube, and the ways between them
    assert env.observation_space("left").shape == (2 * 9 + shared,)
    assert env.observation_space("right").shape == (2 * 7 + shared,)
    assert env.action_space("left") is env.action_space("left")


def test_robots_observe_and_act_for_themselves(env):
    task = tasks.make(TWO)
    obs, _ = env.reset(seed=3)
    flat, _ = task.reset(seed=3)
    rng = np.random.default_rng(0)
    for step in range(1, 6):
        actions = {name: rng.uniform(-1, 1, 8).astype(np.float32) for name in ("right", "left")}
        obs, reward, _, _, info = env.step(actions)
        together = np.concatenate([actions["left"], actions["right"]])[None]
        flat, shared, *_ = task.step(together)
        extra = flat[0, 36:]
        for name, own in (("left", flat[0, :18]), ("right", flat[0, 18:36])):
            np.testing.assert_array_equal(obs[name], np.concatenate([own, extra]))
            assert reward[name] == shared[0].item()
            assert info[name]["elapsed_steps"] == step


def test_a_reward_for_each_robot():
    def earns(robot, observation, reward, info):
        return reward + len(robot) + 0.0 * float(observation[0]) + info["elapsed_steps"]

    env = tasks.parallel_env(TWO, robot_reward=earns)
    shared = tasks.parallel_env(TWO)
    still = {name: np.zeros(8, np.float32) for name in env.possible_agents}
    for each in (env, shared):
        each.reset(seed=0)
    rewards, common = env.step(still)[1], shared.step(still)[1]["left"]
    assert rewards == {"left": common + 4 + 1, "right": common + 5 + 1}


@pytest.mark.parametrize("earned", [np.nan, np.float32(np.inf), None, "much", [1.0, 2.0]])
def test_a_robots_reward_is_a_finite_number(earned):
    env = tasks.parallel_env("PushCube-v1", robot_reward=lambda *_: earned)
    env.reset(seed=0)
    with pytest.raises(TaskError, match="robot_reward returned .* for 'arm' at step 1"):
        env.step({"arm": np.zeros(8, np.float32)})


def test_a_robots_reward_comes_from_a_function():
    with pytest.raises(TaskError, match="robot_reward is 'dense'; a function is needed"):
        tasks.parallel_env(TWO, robot_reward="dense")


def test_all_robots_end_together(env):
    still = {name: np.zeros(8, np.float32) for name in env.possible_agents}
    with pytest.raises(TaskError, match="reset"):
        env.step(still)
    env.reset(seed=0)
    for _ in range(99):
        env.step(still)
        assert env.agents == ["left", "right"]
    *_, truncated, _ = env.step(still)
    assert truncated == {"left": True, "right": True}
    assert env.agents == []


def test_wrong_arguments(env):
    env.reset(seed=0)
    with pytest.raises(ActionError, match="no numbers for \\['right'\\]"):
        env.step({"left": np.zeros(8, np.float32)})
    with pytest.raises(UnknownNameError, match="Did you mean 'left'"):
        env.action_space("lef")
    with pytest.raises(TaskError, match="takes no num_envs"):
        tasks.parallel_env(TWO, num_envs=3)


def test_without_pettingzoo_the_command_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    monkeypatch.delitem(sys.modules, "tasks.interfaces.parallel", raising=False)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[pettingzoo\]'"):
        tasks.parallel_env(TWO)
