"""Grasps and what PhysX remembers of them are native's at every step and every reset."""

from collections.abc import Iterator

import numpy as np
import pytest

from parity.lockstep import differing
from parity.native import native_action, native_agents
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, Pair, pair

pytestmark = [*NATIVE, pytest.mark.long]

GRASPING_TASKS = ("PickCube-v1", "TwoRobotPickCube-v1")  # their motions end with a cube in hand


def grasps(both: Pair) -> tuple[list[bool], list[bool]]:
    """Whether each robot holds the cube: in native, in ours."""
    env = both.native.envs[0]
    state = both.ours.env.simulation.read()
    return (
        [bool(agent.is_grasping(env.cube)) for agent in native_agents(env)],
        [bool(state.is_grasping(robot, "cube")) for robot in both.ours.env.layout],
    )


def play(both: Pair, task_id: str, seed: int, *, rebuild: bool) -> Iterator[list[bool]]:
    """Play a scripted episode, expect equal grasps at every step, and yield them."""
    episode = touching_episode(task_id, seed)
    for side in both:
        side.reset([seed], [0], rebuild=rebuild)
    native, ours = grasps(both)
    assert ours == native, "after the reset"
    yield native
    for step, action in enumerate(episode.actions):
        both.native.envs[0].step(native_action(both.native.envs[0], action))
        both.ours.env.step(action)
        native, ours = grasps(both)
        assert ours == native, f"after step {step}"
        yield native


@pytest.mark.parametrize("task_id", GRASPING_TASKS)
def test_grasps_in_a_rebuilt_world(task_id):
    both = pair(task_id)
    both.forget()
    for seed in (0, 1):
        held = np.array(list(play(both, task_id, seed, rebuild=True)))
        assert (held.sum(axis=0) >= 10).all(), "a robot grasped for less than ten steps"


@pytest.mark.parametrize("task_id", GRASPING_TASKS)
def test_grasps_and_stale_contacts_in_a_world_with_a_past(task_id):
    """Contacts outlive a reset until the next step, so a cube may count as held in no hand."""
    both = pair(task_id)
    both.forget()
    stale = False
    for seed in (0, 1, 2):
        held = np.array(list(play(both, task_id, seed, rebuild=False)))
        assert (held.sum(axis=0) >= 10).all(), "a robot grasped for less than ten steps"
        stale |= held[0].any()
        assert held[-1].any(), "the episode should end with the cube in a hand"
    assert stale, "no grasp outlived a reset, so nothing was tested"


@pytest.mark.parametrize("task_id", TASKS)
def test_reset_after_contact(task_id):
    """Everything that a reset returns is equal right after contact, evaluation included."""
    both = pair(task_id)
    both.forget()
    for seed in (0, 1, 2):
        episode = touching_episode(task_id, seed)
        for action in episode.actions:
            for side in both:
                side.step(action[None])
        native, ours = (side.reset([seed], [0], rebuild=False) for side in both)
        assert differing(native, ours) == []
