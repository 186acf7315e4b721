"""Tasks behind Stable-Baselines3's interface."""

import sys

import gymnasium
import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robots import ActionError, MissingPackageError, SimulationError, TaskError, UnknownNameError

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.torch_layers import NatureCNN
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

TASK = "PushCube-v1"
NUM_ENVS, STEPS = 3, 55  # an episode has 50
SOLVED, SEED = 1, 7  # which environment succeeds; environment i gets SEED + i


def make(num_workers=0, num_envs=NUM_ENVS, **fields):
    return tasks.sb3_vec_env(TASK, num_envs, num_workers, **fields)


@pytest.fixture(scope="module")
def actions():
    """Random ones, but environment 1 does what solves its first episode."""
    rng = np.random.default_rng(0)
    numbers = rng.uniform(-1, 1, (STEPS, NUM_ENVS, 8)).astype(np.float32)
    plan = find_expert(TASK)(tasks.make(TASK), SEED + SOLVED)
    numbers[: len(plan), SOLVED] = plan
    return numbers


def play(env, actions):
    """Everything that an environment says while episodes end at different times."""
    env.seed(SEED)
    infos = env.unwrapped.reset_infos
    said = [env.reset(), [*infos]]
    for action in actions:
        said.append((*env.step(action), [*infos]))
        for info in said[-1][3]:
            if "episode" in info:
                assert info["episode"].pop("t") >= 0.0  # the clock's
    return said


def ends(said, env):
    """In which steps episodes of one environment end."""
    return [step for step, (_, _, done, _, _) in enumerate(said[2:]) if done[env]]


def test_it_says_what_their_own_vector_says(actions):
    env = DummyVecEnv([lambda: gymnasium.make(f"RobotLayouts/{TASK}") for _ in range(NUM_ENVS)])
    theirs, ours = play(VecMonitor(env), actions), play(make(), actions)
    np.testing.assert_equal(ours, theirs)
    (step, *_) = ends(ours, SOLVED)
    assert step < 49
    assert ends(ours, 0) == [49]


def test_success_in_the_last_step_is_no_lack_of_time(actions):
    env = make(num_envs=1)
    env.reset()
    for _ in range(49):
        env.step(actions[0, :1] * 0)
    task = env.vector._backend.batches[0]._task
    state = task.get_state_dict()
    state["actors"]["cube"][:, :2] = state["actors"]["goal_region"][:, :2]
    task.set_state_dict(state)
    _, _, done, infos = env.step(actions[0, :1] * 0)
    assert done.all()
    assert (infos[0]["is_success"], infos[0]["TimeLimit.truncated"]) == (True, False)


@pytest.mark.parametrize("wrap", [lambda env: env, VecMonitor, VecNormalize])
def test_a_training_run_knows_returns_and_lengths_of_episodes(wrap):
    env = wrap(make(max_episode_steps=5))
    model = PPO("MlpPolicy", env, n_steps=6, batch_size=18, n_epochs=1, device="cpu", seed=0)
    model.learn(NUM_ENVS * 6)
    assert [episode["l"] for episode in model.ep_info_buffer] == [5] * NUM_ENVS
    assert all(0 < episode["r"] < 5 for episode in model.ep_info_buffer)


def test_seeds_and_options_count_once():
    env = make()
    assert env.seed(5) == [5, 6, 7]
    first = env.reset()
    assert not np.array_equal(env.reset(), first)
    env.seed(5)
    np.testing.assert_array_equal(env.reset(), first)
    env.set_options({"reconfigure": 1})
    with pytest.raises(TaskError, match="the option 'reconfigure' is 1"):
        env.reset()


def test_named_observations_have_no_nested_names():
    env, task = make(obs_mode="state_dict"), tasks.make(TASK, NUM_ENVS, obs_mode="state_dict")
    env.seed(0)
    obs, tree = env.reset(), task.reset(seed=0)[0]
    assert set(obs) == set(env.observation_space.spaces)
    np.testing.assert_array_equal(obs["agent/qpos"], tree["agent"]["qpos"])
    np.testing.assert_array_equal(obs["extra/tcp_pose"], tree["extra"]["tcp_pose"])
    for _ in range(50):
        *_, infos = env.step(np.zeros((3, 8), np.float32))
    assert set(infos[0]["terminal_observation"]) == set(obs)
    model = PPO("MultiInputPolicy", env, n_steps=2, batch_size=6, n_epochs=1, device="cpu")
    model.learn(6)


def test_what_environments_say_of_themselves():
    env = make()
    assert env.get_attr("max_episode_steps", [0, 2]) == [50, 50]
    assert env.get_attr("action_space", 1) == [env.action_space]
    assert env.has_attr("task_id")
    assert not env.has_attr("task")
    assert env.env_is_wrapped(Monitor) == [False] * NUM_ENVS
    assert env.env_is_wrapped(Monitor, [1]) == [False]
    assert env.spec.id == f"RobotLayouts/{TASK}"
    assert env.metadata["render_fps"] == 20
    with pytest.raises(AttributeError, match="Did you mean 'task_id'"):
        env.get_attr("taskid")
    with pytest.raises(AttributeError, match="rows of a batch"):
        env.env_method("compute_reward")
    with pytest.raises(TaskError, match="reward_mode cannot be set"):
        env.set_attr("reward_mode", "sparse")


def test_wrong_arguments():
    env = make()
    env.reset()
    with pytest.raises(ActionError, match=r"must be \(3, 8\)"):
        env.step(np.zeros((2, 8), np.float32))
    with pytest.raises(SimulationError, match="give them to step_async"):
        env.step_wait()
    with pytest.raises(UnknownNameError, match="Did you mean 'obs_mode'"):
        make(obs_mod="state")
    with pytest.raises(TaskError, match="takes no autoreset_mode"):
        make(autoreset_mode="NEXT_STEP")
    with pytest.raises(TaskError, match="render_mode='rgb_array'"):
        env.get_images()
    env.close()
    env.close()


def test_without_stable_baselines3_the_command_is_named(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("stable_baselines3")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.delitem(sys.modules, "tasks.interfaces.sb3", raising=False)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[sb3\]'"):
        make()


@pytest.mark.parametrize("task_id", [TASK, "TwoRobotPickCube-v1"])
def test_their_own_checks_of_single_environments(task_id):
    check_env(gymnasium.make(f"RobotLayouts/{task_id}").unwrapped, skip_render_check=True)


@pytest.mark.long
def test_images_are_learned_from(drawn):
    env = make(num_envs=2, obs_mode="rgb", timeout=None)
    assert env.reset()["sensor_data/base_camera/rgb"].dtype == np.uint8
    model = PPO("MultiInputPolicy", env, n_steps=2, batch_size=4, n_epochs=1, device="cpu")
    extractors = model.learn(4).policy.features_extractor.extractors
    assert isinstance(extractors["sensor_data/base_camera/rgb"], NatureCNN)


@pytest.mark.long
def test_pictures(drawn):
    env = make(num_envs=2, render_mode="rgb_array", timeout=None)
    env.reset()
    assert env.render("rgb_array").shape == (1024, 512, 3)
    env.close()
