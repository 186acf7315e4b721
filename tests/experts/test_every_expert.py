"""What every expert does: it solves its task in time, as well in native, and repeats itself."""

import numpy as np
import pytest
import torch

import tasks
from parity.native import make_native, native_action
from robot_layouts.experts import find_expert, list_experts
from robot_layouts.experts.rehearsal import rehearsed
from tests.data.expert_plays import REBUILT, episode, plan, same_episodes, seeds, task
from tests.quick import quick_cases

pytestmark = pytest.mark.xdist_group("experts")  # they share plans

FAILURES_OF_10 = {"PickCubeSO100-v1": 2}  # 0 of the others
EXPERTS = list_experts()
CLONED = [name for name in EXPERTS if name in tasks.list_clones()]
EPISODES = [(name, seed) for name in EXPERTS for seed in seeds(name)]
FIRST = [(name, seeds(name)[0]) for name in EXPERTS if not name.startswith("Cell")]


@pytest.mark.parametrize(("name", "seed"), quick_cases(EPISODES, FIRST))
def test_it_solves_its_task_in_time(name: str, seed: int):
    actions = plan(name, seed)
    assert actions.dtype == np.float32
    assert actions.shape[1:] == task(name).single_action_space.shape
    assert len(actions) <= task(name).max_episode_steps
    assert np.abs(actions).max() <= 1
    success = episode(name, seed).success
    assert success[-1]
    assert not success[:-1].any()


@pytest.mark.parametrize(("name", "seed"), quick_cases(EPISODES, FIRST))
def test_its_rehearsal_is_what_its_actions_do_again(name: str, seed: int):
    """So an episode that was rehearsed need not be played once more to be recorded."""
    happened = rehearsed(task(name), seed, plan(name, seed))
    assert happened is not None
    assert same_episodes(happened, episode(name, seed))


@pytest.mark.long
@pytest.mark.native
# mani_skill's own
@pytest.mark.filterwarnings("ignore:__array_wrap__:DeprecationWarning")
@pytest.mark.filterwarnings("ignore:The 'warn' method:DeprecationWarning")
@pytest.mark.parametrize("name", CLONED)
def test_the_same_actions_do_the_same_in_native(name: str):
    native = make_native(name)
    failed: list[int] = []
    for seed in range(10):
        native.reset(seed=seed, options=REBUILT)
        outcomes = [
            bool(native.step(native_action(native, action))[-1]["success"][0])
            for action in plan(name, seed)
        ]
        assert outcomes == episode(name, seed).success.tolist(), f"seed {seed}"
        if not outcomes[-1]:
            failed.append(seed)
    native.close()
    assert len(failed) <= FAILURES_OF_10.get(name, 0), f"failed: {failed}"


@pytest.mark.parametrize("name", quick_cases(CLONED))
def test_it_repeats_itself_and_leaves_the_task_alone(name: str):
    env, seed = tasks.make(name), seeds(name)[-1]
    env.reset(seed=11)
    env.step(torch.zeros(1, *env.single_action_space.shape))
    before = env.get_state_dict()
    np.testing.assert_array_equal(find_expert(name)(env, seed), plan(name, seed))
    after = env.get_state_dict()
    for group, entries in before.items():
        for body, row in entries.items():
            assert torch.equal(after[group][body], row), body
