"""Tasks behind the interface of LeRobot's evaluation, as `lerobot.scripts.lerobot_eval` uses it."""

from contextlib import closing

import numpy as np
import pytest

import tasks
from robot_layouts.data import evaluate
from robot_layouts.experts import find_expert
from robots import TaskError
from tasks.interfaces.vector import UnknownAttributeError

TASK = "TwoRobotPickCube-v1"
SEEDS = [5, 6, 7]
SOLVED = 1  # which environment does what solves the episode of its seed
THEIRS = {"lerobot_new_rollout": True}  # what LeRobot's evaluation passes to every reset


def make(num_workers=0, num_envs=3, **fields):
    return tasks.lerobot_vec_env(TASK, num_envs, num_workers, **fields)


@pytest.fixture(scope="module")
def env():
    with closing(make()) as vector:
        yield vector


def plan_of(seed):
    with closing(tasks.make(TASK)) as task:
        return find_expert(TASK)(task, seed)


@pytest.fixture(scope="module")
def plan():
    """What solves the episode of one seed."""
    return plan_of(SEEDS[SOLVED])


@pytest.fixture(scope="module")
def played(env, plan):
    """What each step returns while one environment succeeds, and the others do nothing."""
    env.reset(seed=SEEDS, options=THEIRS)
    return list(steps(env, plan))


def steps(env, plan):
    (length, *_) = env.call("_max_episode_steps")
    for step in range(length):
        actions = np.zeros((3, 16), np.float32)
        actions[SOLVED] = plan[min(step, len(plan) - 1)]
        yield env.step(actions)


class CarryOut:
    """A policy that gives a plan's actions, and its last one from then on."""

    def __init__(self, plan):
        self.plan, self.step = plan, -1

    def __call__(self, observation):
        self.step += 1
        return self.plan[min(self.step, len(self.plan) - 1)]


def test_states_have_lerobots_names(env):
    obs, _ = env.reset(seed=SEEDS, options=THEIRS)
    assert {name: x.shape for name, x in obs.items()} == {
        "agent_pos": (3, 18),
        "velocity": (3, 18),
        "environment_state": (3, 14),
    }
    assert env.observation_space.contains(obs)
    with closing(tasks.make(TASK, num_envs=3, obs_mode="lerobot")) as task:
        columns, _ = task.reset(SEEDS)
    for name in obs:
        column = "observation." + {"agent_pos": "state"}.get(name, name)
        assert np.array_equal(obs[name], columns[column].numpy())


def test_pixels_are_named_by_camera(renderer):
    with closing(make(num_envs=1, obs_mode="lerobot+cameras", camera_size=(32, 24))) as env:
        obs, _ = env.reset(seed=0)
        shapes = {camera: x.shape for camera, x in obs["pixels"].items()}
        assert env.observation_space.contains(obs)
    cameras = ("base_camera", "left.hand_camera", "right.hand_camera")
    assert shapes == dict.fromkeys(cameras, (1, 24, 32, 3))
    assert all(len(np.unique(x)) > 10 for x in obs["pixels"].values())


def test_each_environment_says_what_is_to_be_done(env):
    assert env.call("task") == env.get_attr("task") == (TASK,) * 3
    assert {*map(type, env.call("task_description"))} == {str}
    assert env.call("task_description")[0].startswith("Hand a cube over")
    assert env.call("_max_episode_steps") == (100,) * 3
    assert env.metadata["render_fps"] == 20


def test_another_instruction_and_length():
    with closing(make(num_envs=1, instruction="Give it here.", max_episode_steps=7)) as env:
        assert env.call("task_description") == ("Give it here.",)
        assert env.call("_max_episode_steps") == (7,)


@pytest.mark.long
def test_success_is_told_when_the_episode_ends_and_from_then_on(played, plan):
    solved = np.array([info["is_success"] for *_, info in played])
    terminated = np.array([step[2] for step in played])
    truncated = np.array([step[3] for step in played])
    (first, *_) = np.flatnonzero(terminated[:, SOLVED])
    assert first <= len(plan) - 1
    assert solved[first:, SOLVED].all()
    assert not solved[:first].any()
    assert terminated[first:, SOLVED].all()
    assert not truncated[:, SOLVED].any()
    assert not np.delete(solved, SOLVED, 1).any()
    assert np.delete(truncated, SOLVED, 1)[-1].all()


def test_only_what_is_reset_begins_anew(env, plan):
    env.reset(seed=SEEDS)
    *_, (_, _, terminated, _, _) = steps(env, plan)
    mask = ~terminated
    env.reset(options={"reset_mask": mask})
    *_, ended, _, info = env.step(np.zeros((3, 16), np.float32))
    assert ended.tolist() == info["is_success"].tolist() == terminated.tolist()


def test_episodes_are_those_of_an_evaluation(env, played, plan):
    still = np.zeros((1, 16), np.float32)
    expected = {
        seed: evaluate(
            CarryOut(plan if i == SOLVED else still), TASK, [seed], workers=0, obs_mode="none"
        ).scores[seed]
        for i, seed in enumerate(SEEDS)
    }
    env.reset(seed=SEEDS, options=THEIRS)
    again = list(steps(env, plan))
    for i, seed in enumerate(SEEDS):
        ended = np.array([step[2] | step[3] for step in again])[:, i]
        assert expected[seed].steps == 1 + ended.argmax()
        assert expected[seed].success == again[-1][4]["is_success"][i]
        total = sum(float(step[1][i]) for step in again)
        assert expected[seed].total == pytest.approx(total, rel=1e-12)


def test_films_are_black_where_nothing_is_drawn(env):
    pictures = env.call("render")
    assert len(pictures) == 3
    assert not np.array(pictures).any()
    with pytest.raises(TaskError, match="render_mode='rgb_array'"):
        env.render()


def test_films_show_each_environment(renderer):
    with closing(make(num_envs=2, render_mode="rgb_array")) as env:
        env.reset(seed=0)
        first, second = env.call("render")
    assert first.shape == second.shape == (512, 512, 3)
    assert (first != second).any()


def test_an_unknown_attribute(env):
    with pytest.raises(UnknownAttributeError, match="Did you mean 'task_description'"):
        env.call("task_descriptions")
    assert not hasattr(env, "envs")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"obs_mode": "lerobot+camera"}, r"Did you mean 'lerobot\+cameras'"),
        ({"obs_mode": "state"}, "unknown obs_mode 'state'"),
        ({"autoreset_mode": "SAME_STEP"}, "takes no autoreset_mode"),
    ],
)
def test_what_lerobot_cannot_use(fields, message):
    with pytest.raises(TaskError, match=message):
        make(**fields)
