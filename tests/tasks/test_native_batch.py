"""Each environment of a batch is a native environment with its own seed."""

import numpy as np
import pytest

from parity.episodes import random_episodes
from parity.lockstep import HISTORIES, differing
from tasks.episode import Episode
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, Pair, complaints, pair
from tests.quick import quick_cases

pytestmark = NATIVE

NUM_ENVS = 8
BATCHED = quick_cases(TASKS, ["PushT-v1"])  # batching is the same in every task


def step_and_compare(both: Pair, rng: np.random.Generator, steps: int) -> None:
    for _ in range(steps):
        actions = rng.uniform(-1.5, 1.5, (NUM_ENVS, both.ours.action_dim)).astype(np.float32)
        native, ours = (side.step(actions) for side in both)
        assert differing(native, ours) == []


@pytest.mark.long
@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("task_id", TASKS)
def test_random_and_scripted_episodes_side_by_side(task_id, history):
    both = pair(task_id, num_envs=NUM_ENVS)
    scripted = [Episode(i, touching_episode(task_id, i).actions[:60]) for i in (0, 1)]
    random = random_episodes(range(2, 2 * NUM_ENVS), 25, both.ours.action_dim)
    results = both.play([*scripted[:1], *random, *scripted[1:]], history)
    assert len(results) == 2 * NUM_ENVS
    assert complaints(results) == []


@pytest.mark.parametrize("task_id", BATCHED)
def test_partial_resets_midway(task_id):
    both = pair(task_id, num_envs=NUM_ENVS)
    both.forget()
    rng = np.random.default_rng(0)
    step_and_compare(both, rng, 15)
    for env_ids, rebuild in (((1, 4, 5), False), ((0, 4), True), ((6,), False)):
        before = both.ours.env.get_state_dict()
        seeds = [100 + 10 * i for i in env_ids]
        native, ours = (side.reset(seeds, env_ids, rebuild=rebuild) for side in both)
        assert differing(native, ours) == []
        expect_untouched(both, before, [i for i in range(NUM_ENVS) if i not in env_ids])
        step_and_compare(both, rng, 10)


def expect_untouched(both: Pair, before: dict, env_ids: list[int]) -> None:
    after = both.ours.env.get_state_dict()
    for group, entries in before.items():
        for name, rows in entries.items():
            np.testing.assert_array_equal(after[group][name][env_ids], rows[env_ids])
