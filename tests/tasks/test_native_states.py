"""States and actions in native's formats mean here what they mean in native."""

import numpy as np
import pytest
import torch

from parity.lockstep import differing
from parity.native import native_action
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, Pair, pair

pytestmark = [*NATIVE, pytest.mark.long]


def recorded_states(both: Pair, task_id: str) -> list[dict]:
    """Play a scripted episode in native and return the state after every tenth step."""
    env = both.native.envs[0]
    episode = touching_episode(task_id, 0)
    env.reset(seed=episode.seed, options={"reconfigure": True})
    states = []
    for step, action in enumerate(episode.actions):
        env.step(native_action(env, action))
        if step % 10 == 9:
            states.append(env.get_state_dict())
    return states


def expect_equal_states(native: dict, ours: dict, what: str) -> None:
    assert {group: list(rows) for group, rows in ours.items()} == {
        group: list(rows) for group, rows in native.items()
    }
    for group, entries in native.items():
        for name, row in entries.items():
            np.testing.assert_array_equal(
                ours[group][name].numpy(), row.numpy(), err_msg=f"{name} {what}"
            )


@pytest.mark.parametrize("task_id", TASKS)
def test_setting_a_state_reaches_what_native_reaches(task_id):
    both = pair(task_id)
    states = recorded_states(both, task_id)
    both.forget()
    for number, state in enumerate(states):
        both.native.envs[0].set_state_dict(state)
        both.ours.env.set_state_dict(state)
        expect_equal_states(
            both.native.envs[0].get_state_dict(),
            both.ours.env.get_state_dict(),
            f"of state {number}",
        )


@pytest.mark.parametrize("task_id", TASKS)
def test_going_on_from_a_state(task_id):
    """From the same past, a state that was set goes on as in native."""
    both = pair(task_id)
    states = recorded_states(both, task_id)
    for state in states[::3]:
        both.forget()
        both.native.envs[0].set_state_dict(state)
        both.ours.env.set_state_dict(state)
        rng = np.random.default_rng(0)
        for step in range(10):
            action = rng.uniform(-1, 1, (1, both.ours.action_dim)).astype(np.float32)
            native, ours = (side.step(action) for side in both)
            assert differing(native, ours) == [], f"step {step}"


@pytest.mark.parametrize("task_id", TASKS)
def test_actions_by_robot_name_are_native_too(task_id):
    """A dict by robot name, in any order, does what native does with the flat action."""
    both = pair(task_id)
    episode = touching_episode(task_id, 0)
    both.forget()
    env = both.ours.env
    for side in both:
        side.reset([episode.seed], [0], rebuild=True)
    for action in episode.actions[:40]:
        parts = {name: torch.from_numpy(action[part]) for name, part in env.action_split.items()}
        obs, reward, *_ = env.step(dict(reversed(parts.items())))
        native = both.native.step(action[None])
        np.testing.assert_array_equal(obs.numpy(), native["observation", "observation"])
        np.testing.assert_array_equal(reward.numpy(), native["reward", "reward"])
