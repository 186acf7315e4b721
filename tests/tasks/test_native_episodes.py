"""Episodes of every task are native's to the last bit: random actions, and scripted contact."""

from contextlib import nullcontext

import numpy as np
import pytest

import tasks
from parity.episodes import random_episodes
from parity.lockstep import HISTORIES, compare, differing
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, complaints, pair

pytestmark = NATIVE

SEEDS = (*range(2, 8), 2**31 - 1, 2**32 - 1)
# Tasks whose joint noise is not drawn from the stream that goes on without a seed, and why.
OTHER_NOISE = {
    **dict.fromkeys(
        ("PlugCharger-v1", *(f"RotateValveLevel{level}-v1" for level in range(5))),
        "native draws its joint noise from torch's global stream",
    ),
    **dict.fromkeys(
        (
            "DrawTriangle-v1",
            "TableTopFreeDraw-v1",
            "UnitreeG1PlaceAppleInBowl-v1",
            "UnitreeG1TransportBox-v1",
        ),
        "native starts them without joint noise",
    ),
}


def has_movable_bodies(task_id):
    world = pair(task_id).ours.env.simulation.worlds[0]
    return any(body.kind == "dynamic" for body in world.bodies.values())


@pytest.mark.parametrize("task_id", TASKS)
def test_a_clone_is_native(task_id):
    """One world of each side, and in turn all that the long tests look at in full.

    Actions over their range, contact, another reward mode, small and large seeds, and a state that
    native was in and from which both go on; each begins with the past of those before it.
    """
    both = pair(task_id)
    modes = tuple(both.native.envs[0].SUPPORTED_REWARD_MODES)
    assert tasks.get_task_class(task_id).reward_modes == modes

    [random] = random_episodes([1], 60, both.ours.action_dim)
    assert abs(random.actions).max() > 2, "no action beyond the range"
    results = both.play([random], "reused")
    with both.rewarding("dense") if "dense" in modes[1:] else nullcontext():
        results += compare(*both, [touching_episode(task_id, 1)], history="reused")
    assert complaints(results) == []
    if has_movable_bodies(task_id):
        assert sum(result.contact_steps for result in results) >= 5, "hardly anything was touched"

    expect_equal_resets(both, SEEDS)

    state = both.native.envs[0].get_state_dict()
    for action in random.actions[:10]:
        native, ours = (side.step(action[None]) for side in both)
        assert differing(native, ours) == []
    both.forget()
    both.native.envs[0].set_state_dict(state)
    both.ours.env.set_state_dict(state)
    told = both.ours.env.get_state_dict()
    for kind, entries in both.native.envs[0].get_state_dict().items():
        assert list(told[kind]) == list(entries)
        for name, rows in entries.items():
            np.testing.assert_array_equal(told[kind][name], rows)
    for action in random.actions[10:20]:
        native, ours = (side.step(action[None]) for side in both)
        assert differing(native, ours) == []


def expect_equal_resets(both, seeds):
    for seed in seeds:
        native, ours = (side.reset([seed], [0], rebuild=False) for side in both)
        assert differing(native, ours) == [], f"seed {seed}"


@pytest.mark.long
@pytest.mark.parametrize("task_id", TASKS)
def test_thousand_seeds_and_the_largest(task_id):
    both = pair(task_id)
    both.forget()
    expect_equal_resets(both, [*range(1000), 2**31 - 1, 2**32 - 1])


@pytest.mark.long
@pytest.mark.parametrize("task_id", [task_id for task_id in TASKS if task_id not in OTHER_NOISE])
def test_without_a_seed_joint_noise_goes_on(task_id):
    """Objects are left out: native draws theirs from torch's global stream, ours from its own."""
    both = pair(task_id)
    both.forget()
    native, ours = both.native.envs[0], both.ours.env
    rebuild = {"reconfigure": True}
    seen = set()
    for seed, options in ((5, {}), (None, {}), (None, rebuild), (None, {}), (None, rebuild)):
        native.reset(seed=seed, options=dict(options))
        ours.reset(seed=seed, options=options)
        rows = ours.get_state_dict()["articulations"]
        for name, row in native.get_state_dict()["articulations"].items():
            np.testing.assert_array_equal(rows[name].numpy(), row.numpy())
            seen.add(tuple(row[0].tolist()))
    assert len(seen) >= 5, "the noise stood still"


@pytest.mark.long
@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize(
    ("task_id", "mode"),
    [(t, mode) for t in TASKS for mode in tasks.get_task_class(t).reward_modes[1:]],
)
def test_reward_modes(task_id, mode, history):
    both = pair(task_id)
    episodes = [touching_episode(task_id, 0), *random_episodes([1], 30, both.ours.action_dim)]
    with both.rewarding(mode):
        assert complaints(both.play(episodes, history)) == []


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
