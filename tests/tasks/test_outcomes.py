"""Episodes that end in failure, and tasks that nothing solves: in every interface, played, kept."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
import torch

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data import evaluate, record
from robot_layouts.data.playing.executor import InProcessExecutor
from robot_layouts.data.receipts import verify
from robot_layouts.experts.rehearsal import rehearse
from tests.tasks.outcome_tasks import Doodle, KeepAway

LOST = "the task counts it as failed"
DOWN, UP = np.zeros((2, 8), np.float32)
DOWN[1] = 0.5
UP[1], UP[3] = -0.5, 0.5


@pytest.fixture(scope="module", autouse=True)
def _registered():
    """Not before other tests have listed all tasks."""
    tasks.register_task("KeepAway-v1")(KeepAway)
    tasks.register_task("Doodle-v1")(Doodle)


def lowers(obs):
    return DOWN


def raises(obs):
    return UP


def played(env, action):
    """Play until the episode ends, and return what the last step returned."""
    for _ in range(env.max_episode_steps):
        step = env.step(action[None])
        if step[2] or step[3]:
            break
    return step


@pytest.mark.parametrize(("action", "reward"), [(DOWN, -1.0), (UP, 1.0)])
def test_an_episode_ends_with_failure_as_with_success(action, reward):
    with closing(tasks.make("KeepAway-v1", reward_mode="sparse")) as env:
        env.reset(0)
        _, found, terminated, truncated, info = played(env, action)
    assert found.dtype == torch.float32
    assert (found.item(), terminated.item(), truncated.item()) == (reward, True, False)
    assert (info["success"].item(), info["fail"].item()) == (reward > 0, reward < 0)


def test_failure_says_nothing_of_dense_rewards():
    with closing(tasks.make("KeepAway-v1")) as env:
        env.reset(0)
        _, reward, terminated, *_ = played(env, DOWN)
    assert terminated
    assert 0 < reward.item() <= 0.06


def test_vectors_begin_anew_after_failure():
    making = {"num_envs": 2, "reward_mode": "sparse", "vectorization_mode": "vector_entry_point"}
    with closing(gymnasium.make_vec("RobotLayouts/KeepAway-v1", **making)) as envs:
        envs.reset(seed=0)
        ends = set()
        for _ in range(12):
            _, reward, terminated, _, info = envs.step(np.stack([DOWN, UP]))
            assert info["is_success"].tolist() == info["success"].tolist()
            ends |= {(i, reward[i].item()) for i in np.flatnonzero(terminated).tolist()}
    assert ends == {(0, -1.0), (1, 1.0)}


def test_failures_are_counted_with_their_reason(tmp_path):
    receipt = tmp_path / "receipt.json"
    found = evaluate(lowers, "KeepAway-v1", range(2), workers=0, receipt=receipt)
    assert found.successes == {0: False, 1: False}
    assert {*found.reasons.values()} == {LOST}
    assert max(found.lengths.values()) < KeepAway.max_episode_steps
    assert verify(receipt, InProcessExecutor(), policy=lowers).equal
    assert evaluate(raises, "KeepAway-v1", [0], workers=0).reasons == {}


def test_experts_stop_where_a_task_is_lost():
    with closing(tasks.make("KeepAway-v1")) as env:
        plan = rehearse(env, 0, lambda scene: DOWN)
        assert plan.reason == LOST
        assert len(plan) < env.max_episode_steps
        assert not rehearse(env, 0, lambda scene: UP).reason


def test_what_nothing_solves_goes_on_until_its_time_is_over():
    assert Doodle.reward_modes == ("none",)
    with closing(tasks.make("Doodle-v1", num_envs=2)) as env:
        _, info = env.reset(0)
        assert {*info} == {"elapsed_steps", "height", "reconfigure"}
        for step in range(5):
            _, reward, terminated, truncated, info = env.step(torch.zeros(2, 8))
            assert not terminated.any()
            assert not reward.any()
            assert truncated.all() == (step == 4)


def test_every_interface_takes_a_task_that_nothing_solves():
    with closing(gymnasium.make("RobotLayouts/Doodle-v1")) as env:
        env.reset(seed=0)
        *_, info = env.step(env.action_space.sample())
        assert not {"success", "is_success"} & {*info}
    making = {"num_envs": 2, "vectorization_mode": "vector_entry_point"}
    with closing(gymnasium.make_vec("RobotLayouts/Doodle-v1", **making)) as envs:
        envs.reset(seed=0)
        for _ in range(6):
            _, _, terminated, truncated, info = envs.step(np.zeros((2, 8), np.float32))
        assert not terminated.any()
        assert not {"success", "is_success"} & {*info}
        assert "height" in info


def test_lerobots_interface_takes_it():
    with closing(tasks.lerobot_vec_env("Doodle-v1", 2, 0)) as envs:
        envs.reset(seed=0)
        *_, info = envs.step(np.zeros((2, 8), np.float32))
        assert not info["is_success"].any()


def test_what_nothing_solves_is_recorded_and_played_again(tmp_path, capsys):
    record("Doodle-v1", range(2), tmp_path, policy=raises, workers=0)
    assert main(["replay", str(tmp_path / "trajectory.h5"), "--workers", "0"]) == 0
    assert "2 of 2" in capsys.readouterr().out


def test_a_class_says_how_often_a_second_it_is_controlled():
    seconds = {}
    for frequency in ({}, {"control_frequency": 50}):
        with closing(tasks.make("Doodle-v1", **frequency)) as env:
            seconds[env.scenario.control_frequency] = env.simulation.substeps
    assert seconds == {10: 10, 50: 2}
    assert tasks.make("KeepAway-v1").scenario.control_frequency == 20
