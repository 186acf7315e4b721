"""Episodes of every task are native's to the last bit: random actions, and scripted contact."""

import pytest

import tasks
from parity.episodes import random_episodes
from parity.lockstep import HISTORIES
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, complaints, pair
from tests.quick import quick_cases

pytestmark = NATIVE

# The second begins in a world that has a past; the others in one that is rebuilt.
SEEDS = {"reused": (1, 2), "fresh": (1,)}
REUSED = quick_cases(HISTORIES, ["reused"])


def other_modes():
    """Every task with each of its reward modes but the first, which other tests use."""
    modes = [(t, mode) for t in TASKS for mode in tasks.get_task_class(t).reward_modes[1:]]
    return quick_cases(modes, [(t, "dense") for t in TASKS])


def has_movable_bodies(task_id):
    world = pair(task_id).ours.env.simulation.worlds[0]
    return any(body.kind == "dynamic" for body in world.bodies.values())


@pytest.mark.parametrize("history", REUSED)
@pytest.mark.parametrize("task_id", TASKS)
def test_random_and_over_range_actions(task_id, history):
    both = pair(task_id)
    episodes = random_episodes(SEEDS[history], 60, both.ours.action_dim)
    assert abs(episodes[0].actions).max() > 2, "no action beyond the range"
    assert complaints(both.play(episodes, history)) == []


@pytest.mark.parametrize(("task_id", "mode"), other_modes())
def test_reward_modes(task_id, mode):
    both = pair(task_id)
    episodes = [touching_episode(task_id, 0), *random_episodes([1], 30, both.ours.action_dim)]
    with both.rewarding(mode):
        assert complaints(both.play(episodes, "reused")) == []


def test_reward_modes_are_natives():
    for task_id in TASKS:
        modes = pair(task_id).native.envs[0].SUPPORTED_REWARD_MODES
        assert tasks.get_task_class(task_id).reward_modes == tuple(modes)


@pytest.mark.parametrize("history", REUSED)
@pytest.mark.parametrize("task_id", TASKS)
def test_scripted_contact(task_id, history):
    episodes = [touching_episode(task_id, seed) for seed in SEEDS[history]]
    results = pair(task_id).play(episodes, history)
    assert complaints(results) == []
    if has_movable_bodies(task_id):
        touched = sum(result.contact_steps for result in results)
        assert touched >= 5 * len(results), "hardly anything was touched"


@pytest.mark.long
@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("task_id", TASKS)
def test_twenty_long_random_episodes(task_id, history):
    both = pair(task_id)
    episodes = random_episodes(range(20), 200, both.ours.action_dim)
    assert complaints(both.play(episodes, history)) == []


@pytest.mark.long
@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("task_id", TASKS)
def test_twenty_scripted_contacts(task_id, history):
    results = pair(task_id).play([touching_episode(task_id, seed) for seed in range(20)], history)
    assert complaints(results) == []
    if has_movable_bodies(task_id):
        assert sum(result.contact_steps >= 5 for result in results) >= 5, "touched too seldom"
