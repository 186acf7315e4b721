"""Policies of LeRobot as `robot_layouts.data.evaluate` takes them: observation → action.

Commands and receipts name what was trained as ``lerobot_env_robot_layouts.policies:policy``, once
LEROBOT_POLICY says where it is, and LEROBOT_TASK in whose task's words it is told what to do.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any

import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs import preprocess_observation
from lerobot.policies import PreTrainedPolicy, get_policy_class, make_pre_post_processors

from tasks import get_task_class
from tasks.description import instruction_of
from tasks.interfaces.lerobot import renamed

FOLDER = "act/checkpoints/last/pretrained_model"  # or what LEROBOT_POLICY says: the `policy`


class LeRobotPolicy:
    """Acts on what ``obs_mode="lerobot"`` observes, as ``lerobot-eval`` lets it act.

    `robot_layouts.data.evaluate` plays each episode with a copy of it, which has seen nothing yet.
    What a policy draws by lot, as a diffusion policy's noise, depends on how often that copy has
    acted, and not on what was played before.

    Attributes:
        files: What it was loaded from, so that receipts hold their checksums; none if that is a
            repository of the hub.
    """

    def __init__(
        self,
        policy: PreTrainedPolicy,
        prepare: Any,
        finish: Any,
        task: str | None = None,
        files: tuple[Path, ...] = (),
    ) -> None:
        """Take a policy.

        Args:
            policy: The policy.
            prepare: LeRobot's pipeline for what it observes.
            finish: LeRobot's pipeline for its actions.
            task: Id of a task, whose instruction it is given; None: it is given none.
            files: What it was loaded from.
        """
        self._policy, self._prepare, self._finish = policy.eval(), prepare, finish
        self._instruction = "" if task is None else instruction_of(get_task_class(task))
        self.files, self._acted = files, 0
        policy.reset()

    @classmethod
    def load(cls, path: str | Path, task: str | None = None, device: str = "cpu") -> LeRobotPolicy:
        """Load what ``lerobot-train`` saved: a folder ``pretrained_model``, or one of the hub.

        Args:
            path: The folder, or the repository's name.
            task: Id of a task, whose instruction the policy is given; None: it is given none.
            device: Where torch computes.
        """
        config = PreTrainedConfig.from_pretrained(path)
        config.device, config.pretrained_path = device, Path(path)
        policy = get_policy_class(config.type).from_pretrained(path, config=config)
        overrides = {"device_processor": {"device": device}}
        prepare, finish = make_pre_post_processors(
            config, str(path), preprocessor_overrides=overrides
        )
        return cls(policy, prepare, finish, task, tuple(sorted(Path(path).glob("*.*"))))

    def __call__(self, observation: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the action, (1, A) float32, for what one environment shows."""
        seen = preprocess_observation(
            renamed({column: value.numpy() for column, value in observation.items()})
        )
        with torch.inference_mode(), torch.random.fork_rng():
            torch.manual_seed(self._acted)
            self._acted += 1
            batch = self._prepare({**seen, "task": [self._instruction]})
            return self._finish(self._policy.select_action(batch)).cpu()


@cache
def _trained() -> LeRobotPolicy:
    path = os.environ.get("LEROBOT_POLICY", FOLDER)
    return LeRobotPolicy.load(path, os.environ.get("LEROBOT_TASK"))


def __getattr__(name: str) -> Any:
    """Return what was trained, as `policy`, so that commands and receipts can name it."""
    if name == "policy":
        return _trained()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
