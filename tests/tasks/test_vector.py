"""Vectors of environments: each is the environment that it would be alone, whoever holds it."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import tasks
from robots import ActionError, TaskError, UnknownNameError
from tasks.interfaces.vector import VectorTask
from tests.quick import quick_cases

NUM_ENVS = 3
WORKERS = 2  # one of them holds one environment, the other two
MODES = list(AutoresetMode)
SHORT = 30  # steps of an episode, where every task is tried
LATER = np.array([False, True, False])  # where episodes begin later than elsewhere


def make(task_id="PushCube-v1", num_envs=NUM_ENVS, num_workers=0, **fields):
    return gymnasium.make_vec(
        f"RobotLayouts/{task_id}", num_envs=num_envs, num_workers=num_workers, **fields
    )


def play(env, mode, steps, seed=7):
    """Everything that a vector says while episodes end at different times.

    Worlds are built with the seeds first: what was drawn of them when they were made depends on
    which environment of how many each was.
    """
    rng = np.random.default_rng(seed)
    width = env.single_action_space.shape
    said = [env.reset(seed=seed, options={"reconfigure": True})]
    for step in range(steps):
        if step == 9:
            said.append(env.reset(seed=50, options={"reset_mask": LATER.copy()}))
        said.append(env.step(rng.uniform(-1.2, 1.2, (NUM_ENVS, *width)).astype(np.float32)))
        over = said[-1][2] | said[-1][3]
        if mode is AutoresetMode.DISABLED and over.any():
            said.append(env.reset(options={"reset_mask": over}))
    return said


def differences(first, second, where=""):
    """Where two sayings differ, as paths; equal ones give nothing."""
    if isinstance(first, dict) and isinstance(second, dict):
        keys = dict.fromkeys([*first, *second])
        return [d for k in keys for d in differences(first.get(k), second.get(k), f"{where}/{k}")]
    if isinstance(first, (list, tuple)) and isinstance(second, (list, tuple)):
        if len(first) != len(second):
            return [f"{where} has another length"]
        pairs = enumerate(zip(first, second, strict=True))
        return [d for i, (a, b) in pairs for d in differences(a, b, f"{where}/{i}")]
    if all(isinstance(x, np.ndarray) and x.dtype.hasobject for x in (first, second)):
        return differences(list(first), list(second), where)
    if first is None or second is None:
        return [] if first is second else [f"{where} is missing"]
    return [] if np.array_equal(first, second) else [where]


def alone(task_id, mode, **fields):
    """Gymnasium's own vector of single environments, and the same first seeds."""
    name = f"RobotLayouts/{task_id}"
    return SyncVectorEnv(
        [lambda: gymnasium.make(name, **fields) for _ in range(NUM_ENVS)], autoreset_mode=mode
    )


def without(said, *keys):
    """Leave out what only a single environment's info tells, at any depth."""
    if isinstance(said, dict):
        return {k: without(v, *keys) for k, v in said.items() if k not in keys}
    return [without(x, *keys) for x in said] if isinstance(said, (list, tuple)) else said


def expect_as_alone(task_id, mode, steps, **fields):
    ours = make(task_id, autoreset_mode=mode, **fields)
    theirs = without(play(alone(task_id, mode, **fields), mode, steps), *RECONFIGURE)
    assert differences(play(ours, mode, steps), theirs) == []


RECONFIGURE = ("reconfigure", "_reconfigure")


@pytest.mark.parametrize("mode", quick_cases(MODES, MODES[:1]))
def test_it_says_what_gymnasiums_own_vector_says(mode):
    expect_as_alone("PushCube-v1", mode, 63)


@pytest.mark.parametrize("task_id", ["PegInsertionSide-v1", "TwoRobotPickCube-v1"])
def test_it_says_so_of_named_observations_too(task_id):
    expect_as_alone(task_id, AutoresetMode.NEXT_STEP, 12, obs_mode="state_dict")


@pytest.mark.long
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("task_id", tasks.list_tasks())
def test_it_says_so_of_every_task(task_id, mode):
    expect_as_alone(task_id, mode, SHORT + 12, max_episode_steps=SHORT)


@pytest.mark.parametrize("mode", quick_cases(MODES, MODES[:1]))
def test_workers_change_nothing(mode):
    together = play(make(autoreset_mode=mode), mode, 63)
    with closing(make(num_workers=WORKERS, autoreset_mode=mode)) as env:
        assert differences(play(env, mode, 63), together) == []
        assert env.num_workers == WORKERS
        assert env.metadata["autoreset_mode"] is mode


def test_a_difference_is_noticed():
    mode = AutoresetMode.NEXT_STEP
    first, second = play(make(), mode, 3), play(make(), mode, 3, seed=8)
    assert differences(first, play(make(), mode, 3)) == []
    assert "/0/0" in differences(first, second)


@pytest.mark.parametrize("ignored", [False, True])
def test_terminations_may_be_ignored(ignored):
    env = make(ignore_terminations=ignored, autoreset_mode="SAME_STEP")
    env.reset(seed=0)
    task = env._backend.batches[0]._task
    state = task.get_state_dict()
    state["actors"]["cube"][1, :2] = state["actors"]["goal_region"][1, :2]
    task.set_state_dict(state)
    _, _, terminated, truncated, info = env.step(np.zeros((NUM_ENVS, 8), np.float32))
    assert terminated.tolist() == [False, not ignored, False]
    assert not truncated.any()
    assert info["elapsed_steps"].tolist() == [1, ignored, 1]
    last = info if ignored else info["final_info"]
    assert last["success"].tolist() == [False, True, False]


def test_a_step_of_some_environments_leaves_the_others_as_they_are():
    task = tasks.make("PickCube-v1", num_envs=NUM_ENVS)
    task.reset(seed=0)
    before = task.get_state_dict()
    info = task.step(np.ones((NUM_ENVS, 8), np.float32), env_ids=[1])[4]
    assert info["elapsed_steps"].tolist() == [0, 1, 0]
    arm = [state["articulations"]["panda"] for state in (before, task.get_state_dict())]
    assert [bool((arm[0][i] == arm[1][i]).all()) for i in range(NUM_ENVS)] == [True, False, True]
    with pytest.raises(TaskError, match="env_ids"):
        task.step(np.ones((NUM_ENVS, 8), np.float32), env_ids=[3])


def test_seeds():
    env = make()
    each = env.reset(seed=[5, 9, 5])[0]
    np.testing.assert_array_equal(each[0], each[2])
    np.testing.assert_array_equal(env.reset(seed=9)[0][0], each[1])
    env.reset(seed=[3, None, 4])
    with pytest.raises(TaskError, match="2 seeds for 3 environments"):
        env.reset(seed=[1, 2])
    with pytest.raises(TaskError, match="must lie from 0"):
        env.reset(seed=-1)


def test_actions_by_robot_and_wrong_ones():
    env = make("TwoRobotPickCube-v1", num_envs=2, num_workers=1)
    with closing(env):
        env.reset(seed=0)
        flat = env.action_space.sample()
        by_robot = {name: flat[:, part] for name, part in env.unwrapped.action_split.items()}
        first = env.step(by_robot)
        env.reset(seed=0, options={"reconfigure": True})
        env.reset(seed=0)
        assert first[0].shape == env.step(flat)[0].shape == env.observation_space.shape
        wrong = flat.copy()
        wrong[1, 9] = np.nan
        with pytest.raises(ActionError, match="nan in environment 1.*robot 'right'"):
            env.step(wrong)
        with pytest.raises(ActionError, match="must be \\(2, 16\\)"):
            env.step(flat[:, :8])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"num_workers": 4}, "num_workers is 4; it must be an integer from 0 to.*3"),
        ({"autoreset_mode": "next"}, "unknown autoreset_mode 'next'. Did you mean 'NEXT_STEP'"),
        ({"num_envs": 0}, "num_envs is 0"),
        ({"reward_mode": "dens"}, "reward_mode 'dens' is not offered"),
        ({"obs_mod": "state"}, "Did you mean 'obs_mode'"),
    ],
)
def test_what_cannot_be_made(fields, message):
    with pytest.raises((TaskError, UnknownNameError), match=message):
        VectorTask("PushCube-v1", **{"num_envs": NUM_ENVS, **fields})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reset_mask": LATER[:2]}, "array of 3 booleans"),
        ({"reset_mask": [True, False, True]}, "array of 3 booleans"),
        ({"reset_mask": np.zeros(3, bool)}, "true somewhere"),
    ],
)
def test_wrong_reset_options(options, message):
    with pytest.raises(TaskError, match=message):
        make().reset(options=options)


@pytest.mark.long
def test_pictures(drawn):
    with closing(make(num_envs=2, num_workers=1, render_mode="rgb_array", timeout=None)) as env:
        env.reset(seed=0)
        pictures = env.render()
    assert [p.shape for p in pictures] == [(512, 512, 3)] * 2
    assert (pictures[0] != pictures[1]).any()
