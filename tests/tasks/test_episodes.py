from collections.abc import Iterator

import numpy as np
import pytest
import torch

import tasks
from robots import SimulationError, TaskError
from tasks import TaskEnv
from tests.quick import quick_cases

ALL = tasks.list_tasks()


def actions(env: TaskEnv, count: int, seed: int = 0) -> torch.Tensor:
    rng = np.random.RandomState(seed)
    shape = (count, *env.action_space.shape)
    return torch.from_numpy(rng.uniform(-1, 1, shape).astype(np.float32))


def play(env: TaskEnv, seed: object, steps: torch.Tensor) -> list[torch.Tensor]:
    observations = [env.reset(seed=seed, options={"reconfigure": True})[0]]
    return observations + [env.step(action)[0] for action in steps]


@pytest.fixture(scope="module", params=ALL)
def each(request: pytest.FixtureRequest) -> Iterator[TaskEnv]:
    """Two environments of each task in turn."""
    env = tasks.make(request.param, num_envs=2)
    yield env
    env.close()


def test_types_and_shapes(each: TaskEnv):
    obs, info = each.reset(seed=1)
    assert obs.dtype == torch.float32
    assert obs.shape == each.observation_space.shape == (2, *each.single_observation_space.shape)
    assert info["elapsed_steps"].tolist() == [0, 0]
    obs, reward, terminated, truncated, info = each.step(actions(each, 1)[0])
    assert reward.dtype == (torch.float64 if each.double_rewards else torch.float32)
    assert reward.shape == (2,)
    judged = () if each.task.open_ended else (info["success"],)
    for flag in (terminated, truncated, *judged):
        assert flag.dtype == torch.bool
        assert flag.shape == (2,)
    assert info["elapsed_steps"].tolist() == [1, 1]


def test_observation_slices_cover_the_observation_in_order(each: TaskEnv):
    ends = [0]
    for part in each.observation_slices.values():
        assert part.start == ends[-1]
        ends.append(part.stop)
    assert ends[-1] == each.single_observation_space.shape[0]
    parts = tasks.make(each.task_id, obs_mode="state_dict").reset(seed=3)[0]
    flat = each.reset(seed=[3, 4])[0]
    for name, value in parts["extra"].items():
        expected = value.float().reshape(1, -1)
        assert torch.equal(flat[:1, each.observation_slices[name]], expected), name


def test_a_state_can_be_taken_and_given_back(each: TaskEnv):
    play(each, 0, actions(each, 5))
    state = each.get_state_dict()
    other = tasks.make(each.task_id, num_envs=2)
    untouched = other.get_state_dict()
    row = {g: {k: v[1:] for k, v in entries.items()} for g, entries in state.items()}
    other.set_state_dict(row, env_ids=[1])
    for group, entries in other.get_state_dict().items():
        for name, rows in entries.items():
            assert torch.equal(rows[0], untouched[group][name][0])
            torch.testing.assert_close(rows[1], state[group][name][1], atol=1e-6, rtol=0)
    other.set_state_dict(state)
    for group, entries in other.get_state_dict().items():
        for name, rows in entries.items():
            torch.testing.assert_close(rows, state[group][name], atol=1e-6, rtol=0)


@pytest.mark.parametrize("task_id", quick_cases(ALL))
def test_one_environment_of_many_equals_one_alone(task_id: str):
    many = tasks.make(task_id, num_envs=3)
    steps = actions(many, 20)
    together = play(many, 5, steps)
    for i in range(3):
        alone = play(tasks.make(task_id), 5 + i, steps[:, i : i + 1])
        for t, (a, b) in enumerate(zip(together, alone, strict=True)):
            assert torch.equal(a[i], b[0]), f"environment {i}, step {t}"


@pytest.mark.parametrize("task_id", quick_cases(ALL))
def test_a_partial_reset_leaves_the_others_alone(task_id: str):
    env, undisturbed = tasks.make(task_id, num_envs=3), tasks.make(task_id, num_envs=3)
    steps = actions(env, 8)
    play(env, 0, steps[:4])
    play(undisturbed, 0, steps[:4])
    obs, info = env.reset(seed=[77], env_ids=[1])
    assert info["elapsed_steps"].tolist() == [4, 0, 4]
    assert torch.equal(obs[1], tasks.make(task_id).reset(seed=77)[0][0])
    for action in steps[4:]:
        a, b = env.step(action)[0], undisturbed.step(action)[0]
        assert torch.equal(a[[0, 2]], b[[0, 2]])


def test_seeds():
    env = tasks.make("PickCube-v1", num_envs=2)
    by_number, by_list = env.reset(seed=4)[0], env.reset(seed=[4, 5])[0]
    assert torch.equal(by_number, by_list)
    assert not torch.equal(by_number[0], by_number[1])
    first, second = env.reset(seed=4)[0], env.reset()[0]
    assert not torch.equal(first, second)
    env.reset(seed=4)
    assert torch.equal(env.reset()[0], second)
    assert torch.equal(env.reset(seed=np.array([4, 5]))[0], by_list)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": "a"}, "seed is 'a'"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"seed": -1}, "must lie from 0"),
        ({"seed": [1]}, "1 seeds for 2 environments"),
        ({"env_ids": [2]}, r"env_ids \[2\] must be different numbers from 0 to 1"),
        ({"env_ids": [0, 0]}, "must be different"),
        ({"env_ids": [-1]}, "from 0 to 1"),
        ({"env_ids": [0.5]}, "takes a sequence of integers"),
        ({"env_ids": 1}, "takes a sequence of integers"),
        ({"options": {"reconfig": True}}, "Did you mean 'reconfigure'"),
    ],
)
def test_a_wrong_reset_changes_nothing(arguments: dict[str, object], message: str):
    env = tasks.make("PickCube-v1", num_envs=2)
    env.reset(seed=0)
    before = env.get_state_dict()
    with pytest.raises(TaskError, match=message):
        env.reset(**arguments)
    for group, entries in env.get_state_dict().items():
        for name, rows in entries.items():
            assert torch.equal(rows, before[group][name])
    env.step(torch.zeros(2, 8))


def test_a_wrong_action_moves_nothing():
    env, other = tasks.make("PickCube-v1"), tasks.make("PickCube-v1")
    for e in (env, other):
        e.reset(seed=0)
    for bad in (np.full((1, 8), np.nan), np.zeros((1, 7)), np.zeros((1, 8), int)):
        with pytest.raises(ValueError, match="action"):
            env.step(bad)
    action = torch.full((1, 8), 0.5)
    assert torch.equal(env.step(action)[0], other.step(action)[0])


def test_the_state_is_that_of_now():
    env = tasks.make("PickCube-v1", num_envs=2)
    for _ in range(2):
        env.reset(seed=3)
        obs, _, _, _, info = env.step(actions(env, 1)[0])
        judged = env.evaluate(env.state)
        assert {name: info[name].tolist() for name in judged} == {
            name: flags.tolist() for name, flags in judged.items()
        }
        place = obs[:, env.observation_slices["tcp_pose"]].numpy()
        np.testing.assert_array_equal(env.state.tcp_pose("arm"), place)


def test_a_closed_task_says_so():
    env = tasks.make("PickCube-v1")
    env.close()
    env.close()
    with pytest.raises(SimulationError, match="is closed"):
        _ = env.state
    with pytest.raises(SimulationError, match="is closed"):
        env.step(torch.zeros(1, 8))
    with pytest.raises(SimulationError, match="is closed"):
        env.reset()


def test_what_is_returned_may_be_changed_without_harm():
    env, other = tasks.make("PickCube-v1"), tasks.make("PickCube-v1")
    env.reset(seed=0)
    other.reset(seed=0)
    for action in actions(env, 5):
        outcome = env.step(action)
        expected = other.step(action)[0]
        assert torch.equal(outcome[0], expected)
        for value in (*outcome[:4], *outcome[4].values()):
            value.zero_()
