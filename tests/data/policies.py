"""Policies for tests; worker processes import this module."""

import os
import random
import signal
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


@dataclass
class Leans:
    """Depends on nothing but each observation, for one or for many at once."""

    batched: bool = False
    actions: int = ACTIONS
    strength: float = 3

    def __call__(self, obs):
        return torch.tanh(obs[:, : self.actions] * self.strength)


LEANS = Leans()


def meddles(obs):
    """Takes over at about every other step."""
    return np.full(ACTIONS, 0.25, np.float32) if random.random() < 0.5 else None


def quiet(obs):
    """Could take over, and does not, whatever it draws."""
    random.random()
    assert len(obs) == 1


def fails_at_times(obs):
    if random.random() < 0.004:
        raise ValueError("not this one")
    return still(obs)


def dies_at_times(obs):
    """Takes its process along where `fails_at_times` fails."""
    try:
        return fails_at_times(obs)
    except ValueError:
        dies(obs)


def dies(obs):
    """Takes its process along."""
    os.kill(os.getpid(), signal.SIGKILL)


def too_few(count, obs):
    return None if count is None else np.zeros((count, ACTIONS), np.float32)
