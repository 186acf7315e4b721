"""PPO learns to push a cube in thousands of worlds on one device, and leaves its learning curve.

    pip install 'robot-layouts[mujoco_warp]'
    python examples/ppo_on_device.py --device cuda:0

Worlds, policy and learning stay on the device. The policy is examined without noise on starts that
it never learns from. On a processor, ``--device cpu --envs 16 --steps 2000`` shows that it runs.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from robots import RobotLayoutsError
from tasks.interfaces.device import DeviceTask

EPISODE = 50  # steps
TEST_SEED = 1_000_000  # of the first start to be examined from
WIDTH = 256  # of the networks' layers
RATE, DISCOUNT, TRACE, CLIP, GRADIENT = 7e-4, 0.9, 0.95, 0.2, 0.5
EPOCHS, PARTS, MOST_CHANGE = 8, 32, 0.1  # of each batch, and how far a policy may leave it (KL)


class Policy(nn.Module):
    """What acts, and what tells how good a state is."""

    mean: Tensor
    variance: Tensor
    count: Tensor

    def __init__(self, seen: int, numbers: int) -> None:
        """Take the numbers of an observation and of an action."""
        super().__init__()
        self.register_buffer("mean", torch.zeros(seen))  # of what was seen, and its variance
        self.register_buffer("variance", torch.ones(seen))
        self.register_buffer("count", torch.tensor(1e-4))
        self.actor, self.critic = _network(seen, numbers, 0.01), _network(seen, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((numbers,), -0.5))

    @torch.no_grad()
    def look(self, obs: Tensor) -> None:
        """Take observations, (N, D), into their mean and variance, by which they are normalised."""
        count = self.count + len(obs)
        way, share = obs.mean(0) - self.mean, len(obs) / count
        self.mean += way * share
        self.variance += (obs.var(0) + way * way * (1 - share) - self.variance) * share
        self.count.copy_(count)

    def best(self, obs: Tensor) -> Tensor:
        """Return the mean actions, (N, A)."""
        return self.actor(self._normalised(obs))

    def distribution(self, obs: Tensor) -> torch.distributions.Normal:
        """Return how actions are distributed, (N, A)."""
        spread = self.log_std.exp()
        return torch.distributions.Normal(self.best(obs), spread, validate_args=False)

    def value(self, obs: Tensor) -> Tensor:
        """Return what is still to be earned, (N,)."""
        return self.critic(self._normalised(obs))[:, 0]

    def _normalised(self, obs: Tensor) -> Tensor:
        return ((obs - self.mean) / (self.variance + 1e-8).sqrt()).clamp(-5.0, 5.0)


class Batch(NamedTuple):
    """What was seen and done, (steps, N, …) each, or (steps · N, …)."""

    obs: Tensor
    action: Tensor
    chance: Tensor
    value: Tensor
    advantage: Tensor


def _network(inside: int, outside: int, scale: float) -> nn.Sequential:
    layers: list[nn.Module] = []
    for width in (inside, WIDTH, WIDTH):
        layers += [_layer(width, WIDTH, 2**0.5), nn.Tanh()]
    return nn.Sequential(*layers, _layer(WIDTH, outside, scale))


def _layer(inside: int, outside: int, scale: float) -> nn.Linear:
    layer = nn.Linear(inside, outside)
    nn.init.orthogonal_(layer.weight, scale)
    nn.init.zeros_(layer.bias)
    return layer


@torch.no_grad()
def rollout(env: DeviceTask, policy: Policy, obs: Tensor, steps: int) -> tuple[Batch, Tensor]:
    """Let a policy act for some steps; returns them, and what is seen after the last."""
    rows: list[tuple[Tensor, ...]] = []
    for _ in range(steps):
        actions = policy.distribution(obs)
        action = actions.sample()
        after, reward, terminated, truncated, info = env.step(action)
        over = terminated | truncated
        later = policy.value(torch.where(over[:, None], info["final_obs"], after))
        chance = actions.log_prob(action).sum(1)
        rows.append((obs, action, chance, policy.value(obs), reward + DISCOUNT * later, over))
        obs = after
    seen, action, chance, value, target, over = (
        torch.stack(part) for part in zip(*rows, strict=True)
    )
    advantage = target - value
    for step in reversed(range(steps - 1)):
        advantage[step] += DISCOUNT * TRACE * ~over[step] * advantage[step + 1]
    return Batch(seen, action, chance, value, advantage), obs


def improve(policy: Policy, optimizer: torch.optim.Optimizer, batch: Batch) -> None:
    """Improve a policy by what it did."""
    flat = Batch(*(part.flatten(0, 1) for part in batch))
    count = len(flat.value)
    for _ in range(EPOCHS):
        changes: list[Tensor] = []
        for rows in torch.randperm(count, device=flat.value.device).chunk(PARTS):
            obs, action, chance, value, advantage = (part[rows] for part in flat)
            actions = policy.distribution(obs)
            change = actions.log_prob(action).sum(1) - chance
            changes.append(((change.exp() - 1) - change).detach().mean())
            worth = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            clipped = change.exp().clamp(1 - CLIP, 1 + CLIP)
            gain = torch.minimum(change.exp() * worth, clipped * worth).mean()
            error = (policy.value(obs) - (value + advantage)).square().mean()
            optimizer.zero_grad(set_to_none=True)
            (0.5 * error - gain).backward()
            nn.utils.clip_grad_norm_(policy.parameters(), GRADIENT)
            optimizer.step()
        if torch.stack(changes).mean() > MOST_CHANGE:
            break
    policy.look(flat.obs)


@torch.no_grad()
def examine(env: DeviceTask, policy: Policy) -> tuple[float, float]:
    """Return which share of test episodes succeeds at some step, and at the last one."""
    obs, _ = env.reset(seed=TEST_SEED)
    succeeded = last = torch.zeros(env.num_envs, dtype=torch.bool, device=env.device)
    for _ in range(EPISODE):
        obs, *_, info = env.step(policy.best(obs))
        last = info["success"]
        succeeded = succeeded | last
    return succeeded.float().mean().item(), last.float().mean().item()


def learn(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Learn until enough test episodes succeed; returns the learning curve."""
    torch.manual_seed(options.seed)
    curve: list[dict[str, Any]] = []
    with (
        closing(_made(options, options.envs, "SameStep", 0)) as env,
        closing(_made(options, options.tests, "Disabled", TEST_SEED)) as tests,
    ):
        shapes = env.single_observation_space.shape, env.single_action_space.shape
        policy = Policy(*(shape[0] for shape in shapes if shape)).to(env.device)
        optimizer = torch.optim.Adam(policy.parameters(), lr=RATE, eps=1e-5)
        obs, _ = env.reset(seed=options.seed)
        policy.look(obs)
        steps, seconds = 0, 0.0
        while True:
            success, at_end = examine(tests, policy)
            found = {"steps": steps, "seconds": round(seconds, 1), "success": success}
            curve.append({**found, "success_at_end": at_end})
            print(json.dumps(curve[-1]), flush=True)
            if success >= options.enough or steps >= options.steps:
                return curve
            since = time.perf_counter()
            for _ in range(options.rounds):
                batch, obs = rollout(env, policy, obs, options.horizon)
                improve(policy, optimizer, batch)
                steps += options.envs * options.horizon
            if env.device.type == "cuda":
                torch.cuda.synchronize(env.device)
            seconds += time.perf_counter() - since


def _made(options: argparse.Namespace, count: int, mode: str, seed: int) -> DeviceTask:
    return DeviceTask(
        options.task,
        count,
        options.device,
        mode,
        ignore_terminations=True,
        starts=max(count, 64),
        first_seed=seed,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the example.

    Args:
        arguments: Words of the command line; by default those of this process.

    Returns:
        0 if enough test episodes succeed at the end, else 1.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--task", default="PushCube-v1", help="task (default %(default)s)")
    add("--device", default="cuda:0", help="cuda:0 or cpu (default %(default)s)")
    add("--steps", type=int, default=5_000_000, help="steps at most (default %(default)s)")
    add("--envs", type=int, default=1024, help="environments to learn in (default %(default)s)")
    add("--tests", type=int, default=512, help="test episodes (default %(default)s)")
    add("--horizon", type=int, default=25, help="steps of a batch (default %(default)s)")
    add("--rounds", type=int, default=5, help="batches between examinations (default %(default)s)")
    add("--enough", type=float, default=0.95, help="share that is enough (default %(default)s)")
    add("--seed", type=int, default=0, help="of the policy and of the episodes (default 0)")
    add("--out", type=Path, default=Path("runs/ppo_on_device"), help="folder (default %(default)s)")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        curve = learn(options)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    numbers = {"task": options.task, "environments": options.envs, "curve": curve}
    (options.out / "learning_curve.json").write_text(json.dumps(numbers, indent=1) + "\n")
    return 0 if curve[-1]["success"] >= options.enough else 1


if __name__ == "__main__":
    sys.exit(main())
