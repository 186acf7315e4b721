"""Carries out, step by step, what was recorded where an episode began most like this one."""

import numpy as np
import torch
from lerobot.policies import PreTrainedPolicy
from lerobot.utils.constants import ACTION, OBS_ENV_STATE

from lerobot_policy_replay.configuration_replay import ReplayConfig


class ReplayPolicy(PreTrainedPolicy):
    """Remembers recordings; of each environment, which one it is in."""

    config_class = ReplayConfig
    name = "replay"

    def __init__(self, config: ReplayConfig, **kwargs) -> None:
        super().__init__(config)
        config.validate_features()
        self.size = config.output_features[ACTION].shape[0]
        self.starts, self.plans = read(config.plans)
        self.reset()

    def reset(self) -> None:
        """Choose recordings anew at the next observation."""
        self.step, self.chosen = -1, None

    def get_optim_params(self) -> dict:
        return {}

    def forward(self, batch):
        raise NotImplementedError("nothing is learnt")

    def predict_action_chunk(self, batch, **kwargs):
        return self.select_action(batch)[:, None]

    def select_action(self, batch, **kwargs) -> torch.Tensor:
        """Return the next actions, (N, A)."""
        seen = batch[OBS_ENV_STATE].numpy()
        if self.chosen is None:
            apart = np.linalg.norm(seen[:, None] - self.starts[None], axis=2)
            self.chosen = apart.argmin(1)
        self.step += 1
        plans = [self.plans[i] for i in self.chosen]
        rows = [plan[min(self.step, len(plan) - 1)] for plan in plans]
        assert all(row.shape == (self.size,) for row in rows)
        return torch.from_numpy(np.stack(rows))


def read(path: str):
    """Return what was observed at first, (K, d), and the K plans, (T, A) each."""
    file = np.load(path)
    count = sum(name.startswith("start/") for name in file.files)
    starts = np.stack([file[f"start/{i}"] for i in range(count)])
    return starts, [file[f"actions/{i}"] for i in range(count)]
