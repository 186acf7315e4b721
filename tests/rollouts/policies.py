"""Policies for tests; worker processes import this module."""

import random
from dataclasses import dataclass, field

import numpy as np
import torch

TASK = "PushT-v1"  # 7 action numbers
ACTIONS = 7


def still(obs):
    return torch.zeros(1, ACTIONS)


@dataclass
class Wanders:
    """Remembers what it did, and draws from every generator there is."""

    scale: float = 1.0
    past: list[float] = field(default_factory=list)

    def __call__(self, obs):
        assert obs.shape == (1, 31)
        drawn = torch.rand(ACTIONS) - np.random.rand() + random.random() + len(self.past) / 100
        self.past.append(float(obs.sum()))
        return self.scale * torch.tanh(drawn + sum(self.past))


def fails(obs):
    return {}["no such key"]
