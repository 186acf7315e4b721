"""Policies of LeRobot as `robot_layouts.data.evaluate` takes them: observation → action."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs import preprocess_observation
from lerobot.policies import PreTrainedPolicy, get_policy_class, make_pre_post_processors

from tasks import get_task_class
from tasks.description import instruction_of
from tasks.interfaces.lerobot import renamed


class LeRobotPolicy:
    """Acts on what ``obs_mode="lerobot"`` observes, as ``lerobot-eval`` lets it act.

    `robot_layouts.data.evaluate` plays each episode with a copy of it, which has seen nothing yet.
    """

    def __init__(self, policy: PreTrainedPolicy, prepare: Any, finish: Any, task: str) -> None:
        """Take a policy.

        Args:
            policy: The policy.
            prepare: LeRobot's pipeline for what it observes.
            finish: LeRobot's pipeline for its actions.
            task: Id of a task, whose instruction it is given.
        """
        self._policy, self._prepare, self._finish = policy.eval(), prepare, finish
        self._instruction = instruction_of(get_task_class(task))
        policy.reset()

    @classmethod
    def load(cls, path: str | Path, task: str, device: str = "cpu") -> LeRobotPolicy:
        """Load what ``lerobot-train`` saved: a folder ``pretrained_model``, or one of the hub.

        Args:
            path: The folder, or the repository's name.
            task: Id of a task, whose instruction the policy is given.
            device: Where torch computes.
        """
        config = PreTrainedConfig.from_pretrained(path)
        config.device, config.pretrained_path = device, Path(path)
        policy = get_policy_class(config.type).from_pretrained(path, config=config)
        overrides = {"device_processor": {"device": device}}
        pipelines = make_pre_post_processors(config, str(path), preprocessor_overrides=overrides)
        return cls(policy, *pipelines, task)

    def __call__(self, observation: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the action, (1, A) float32, for what one environment shows."""
        seen = preprocess_observation(
            renamed({column: value.numpy() for column, value in observation.items()})
        )
        with torch.inference_mode():
            batch = self._prepare({**seen, "task": [self._instruction]})
            return self._finish(self._policy.select_action(batch)).cpu()
