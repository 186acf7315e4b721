"""What test_mappo_two_arms asks in the environment that has torchrl; its word is a run's folder."""

import sys
from pathlib import Path

import mappo_two_arms as mappo
import numpy as np
import pytest
import torch
from torchrl.envs import check_env_specs
from torchrl_arms import OBSERVATION, Arms

import tasks
from robot_layouts.data import evaluate
from robots import TaskError

TASK = "TwoRobotPickCube-v1"
MAKING = {"control_mode": "pd_ee_delta_pos"}


def torchrl_accepts_the_environment() -> None:
    arms = Arms(TASK, 2, 0, **MAKING)
    check_env_specs(arms)
    assert arms.rollout(200).batch_size == (2, 100)
    arms.close()


def agents_are_those_of_pettingzoo() -> None:
    arms, pair = Arms(TASK, 2, 0, **MAKING), tasks.parallel_env(TASK, **MAKING)
    arms.set_seed(7)
    played = arms.rollout(5)
    for world in range(2):
        observations, _ = pair.reset(seed=7 + world)
        for step in range(5):
            for agent, own in enumerate(observations.values()):
                assert np.array_equal(played[OBSERVATION][world, step, agent].numpy(), own)
            actions = played["agents", "action"][world, step].numpy()
            found = pair.step(dict(zip(pair.agents, actions, strict=True)))
            observations, rewards = found[:2]
            assert rewards["left"] == played["next", "agents", "reward"][world, step, 0].item()
    arms.close()
    pair.close()


def agents_that_differ_are_refused() -> None:
    with pytest.raises(TaskError, match="left, right observe 48, 44 numbers and do 8, 7"):
        Arms(TASK, 1, 0, robots={"right": "panda_stick"})


def an_actor_sees_its_own_arm(folder: Path) -> None:
    """What only the other arm observes does not change what an arm does."""
    policy = mappo.LearnedPolicy(folder, mappo.FILES, mappo._loaded)
    obs = torch.randn(1, 66, generator=torch.Generator().manual_seed(0))
    moved = obs.clone()
    moved[0, 18:36] += 1.0  # the right arm's joints
    before, after = policy(obs), policy(moved)
    assert np.array_equal(before[:4], after[:4])
    assert not np.array_equal(before[4:], after[4:])


def it_can_be_evaluated(folder: Path) -> None:
    policy = mappo.LearnedPolicy(folder, mappo.FILES, mappo._loaded)
    found = [evaluate(policy, TASK, [5, 6], workers=n, num_envs=2, **MAKING) for n in (0, 1)]
    assert found[0].scores == found[1].scores


if __name__ == "__main__":
    run = Path(sys.argv[1])
    torchrl_accepts_the_environment()
    agents_are_those_of_pettingzoo()
    agents_that_differ_are_refused()
    an_actor_sees_its_own_arm(run)
    it_can_be_evaluated(run)
