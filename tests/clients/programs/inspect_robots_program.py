"""Inspect Robots: an expert's episodes through its evaluation are ours, to the last bit."""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[3] / "integrations/inspect_robots_robot_layouts"))

from inspect_robots import eval as evaluated
from inspect_robots.conformance import assert_embodiment_conformant
from inspect_robots.policy import PolicyBase, PolicyInfo
from inspect_robots.types import Action, ActionChunk
from inspect_robots_robot_layouts import RobotLayouts, benchmark

import tasks
from robot_layouts.experts import find_expert

TASK, SEEDS = "TwoRobotPickCube-v1", range(2)


class Expert(PolicyBase):
    """Carries out the expert's plan for the seed that a scene begins with."""

    def __init__(self, body):
        super().__init__()
        info = body.info
        self.info = PolicyInfo("expert", info.action_space, info.observation_space)
        self._task, self._expert = tasks.make(TASK), find_expert(TASK)

    def reset(self, scene):
        self._plan = iter(self._expert(self._task, scene.init_seed))
        self._instruction = scene.instruction

    def act(self, observation):
        assert observation.instruction == self._instruction
        assert observation.state["joint_pos"].shape == (16,)
        return ActionChunk([Action(next(self._plan))])


class Kept:
    """Keeps the rewards of every trial."""

    def __init__(self):
        self.rewards = []

    def __call__(self, record, scene):
        self.rewards.append([step.result.reward for step in record.steps])


def step_here(seed):
    """Return the rewards of the expert's plan until the episode ends, and whether it succeeds."""
    task = tasks.make(TASK)
    plan, rewards = find_expert(TASK)(task, seed), []
    task.reset(seed, {"reconfigure": True})
    for action in plan:
        _, reward, terminated, truncated, info = task.step(np.asarray(action, np.float32))
        rewards.append(reward[0].item())
        if terminated[0] or truncated[0]:
            break
    return rewards, bool(info["success"][0])


def main():
    body, kept = RobotLayouts(TASK), Kept()
    assert_embodiment_conformant(body.info)
    assert_embodiment_conformant(RobotLayouts(TASK, control_mode="pd_joint_pos").info)
    (log,) = evaluated(
        benchmark(TASK, episodes=len(SEEDS)),
        Expert(body),
        body,
        log_dir=sys.argv[1],
        before_scoring=kept,
    )
    assert log.status == "success", log
    solved = [bool(sample.epochs[0]["success_at_end"]) for sample in log.samples]
    stepped = [step_here(seed) for seed in SEEDS]
    assert solved == [success for _, success in stepped]
    assert kept.rewards == [rewards for rewards, _ in stepped]


if __name__ == "__main__":
    main()
