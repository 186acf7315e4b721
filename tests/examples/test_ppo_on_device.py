"""The example that learns on a device."""

import importlib.util
from pathlib import Path

import pytest
import torch

EXAMPLE = Path(__file__).parent.parent.parent / "examples" / "ppo_on_device.py"
SPEC = importlib.util.spec_from_file_location("ppo_on_device", EXAMPLE)
ppo = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(ppo)


class Reach:
    """Points that move by their actions, rewarded for how near they come to places."""

    num_envs, device = 256, torch.device("cpu")

    def __init__(self):
        self._at, self._to = torch.zeros(2, self.num_envs, 3)
        self._steps = 0
        self.begin()

    def begin(self):
        self._at, self._to = torch.zeros_like(self._at), torch.rand_like(self._to) - 0.5
        self._steps = 0
        return self.seen

    @property
    def seen(self):
        return torch.cat((self._at, self._to), 1)

    def step(self, action):
        self._at = self._at + 0.05 * action.clamp(-1, 1)
        self._steps += 1
        reward = 1 - torch.tanh(5 * (self._at - self._to).norm(dim=1))
        last, over = self.seen, torch.full((self.num_envs,), self._steps == ppo.EPISODE)
        after = self.begin() if over.all() else last
        return after, reward, torch.zeros_like(over), over, {"final_obs": last}


@pytest.mark.long
def test_points_learn_to_go_where_they_are_sent(monkeypatch):
    monkeypatch.setattr(ppo, "PARTS", 8)
    torch.manual_seed(0)
    env, policy = Reach(), ppo.Policy(6, 3)
    optimizer = torch.optim.Adam(policy.parameters(), lr=ppo.RATE)
    obs = env.seen
    policy.look(obs)
    rewards = []
    for _ in range(24):
        batch, obs = ppo.rollout(env, policy, obs, 25)
        ppo.improve(policy, optimizer, batch)
        rewards.append((batch.value + batch.advantage).mean().item())
    assert max(rewards[:2]) < 2.5
    assert max(rewards[-2:]) > 5.0  # of at most 10


def test_what_is_seen_is_normalised():
    policy = ppo.Policy(2, 1)
    rows = torch.randn(4, 500, 2) * torch.tensor([3.0, 0.1]) + torch.tensor([5.0, -1.0])
    for part in rows:
        policy.look(part)
    torch.testing.assert_close(policy.mean, rows.mean((0, 1)), rtol=1e-3, atol=1e-3)
    torch.testing.assert_close(policy.variance, rows.var((0, 1)), rtol=1e-2, atol=1e-3)


def test_a_card_that_is_not_there_ends_it_with_a_sentence(tmp_path, capsys):
    assert ppo.main(["--device", "cuda:9", "--out", str(tmp_path)]) == 1
    assert "error: device 'cuda:9' is not there" in capsys.readouterr().err
