"""torchrl's MAPPO learns what several arms shall do, with one policy per arm and a shared critic.

    pip install 'robot-layouts[pettingzoo,preview]' torchrl
    python examples/mappo_two_arms.py                     # TwoRobotPickCube, in hours

An arm is an agent as in `tasks.parallel_env`: it observes its own joints and the task's objects,
and decides its own action numbers. The critic sees what all observe, and is needed only to learn.
Two runs give the same weights, and so does one that is killed and started again. What was learned
is a policy that can be imported:

    PYTHONPATH=examples robot-layouts evaluate --policy mappo_two_arms:policy \
        --task TwoRobotPickCube-v1 --control-mode pd_ee_delta_pos
"""

# torchrl need not be installed where types are checked.
# pyright: reportMissingImports=false, reportUntypedBaseClass=false
# pyright: reportUnknownParameterType=false

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import torch
from learning_runs import (
    LearnedPolicy,
    Learner,
    first_seed,
    main,
    making_of,
    read_arguments,
)
from numpy.typing import NDArray
from tensordict import TensorDictBase
from tensordict.nn import AddStateIndependentNormalScale, InteractionType, TensorDictModule
from torch import Tensor, nn
from torch.distributions import Independent, Normal
from torch.optim import Adam
from torchrl.modules import MultiAgentMLP, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl_arms import ACTION, OBSERVATION, REWARD, Arms

from tasks import get_task_class

FOLDER = "runs/mappo_two_arms"
FILES = ("policy.pt",)

VALUE, LOC, SCALE = (("agents", name) for name in ("value", "loc", "scale"))


@dataclass(frozen=True)
class Recipe:
    """How a task is learned; PPO's of `ppo_two_arms`, where there is no reason for another."""

    steps: int = 16_000_000
    control_mode: str = "pd_ee_delta_pos"
    every: int = 40  # iterations from one checkpoint to the next; one is an episode of each world
    learning_rate: float = 3e-4  # at first; it falls to 0
    batch_size: int = 800
    epochs: int = 4
    gamma: float = 0.9
    gae_lambda: float = 0.95
    clip: float = 0.2
    max_grad_norm: float = 0.5
    width: int = 256
    depth: int = 2
    log_std: float = -1.0


class _Gaussian(Independent[Normal]):
    """Actions of one agent, drawn together: one probability for all its numbers."""

    def __init__(self, loc: Tensor, scale: Tensor) -> None:
        super().__init__(Normal(loc, scale), 1)


class Statistics(nn.BatchNorm1d):
    """Mean and deviation of all that it was shown, for each number."""

    def __init__(self, numbers: int) -> None:
        """Know nothing yet of rows of so many numbers."""
        super().__init__(numbers, affine=False, momentum=None)
        self.eval()

    def look(self, rows: Tensor) -> None:
        """Take more rows, (n, numbers), into the mean and the deviation."""
        self.train()
        self(rows)
        self.eval()


class Normalized(nn.Module):
    """Observations (…, A, D) by their mean and deviation, as they were when it last looked."""

    def __init__(self, agents: int, seen: int) -> None:
        """Know nothing yet of what ``agents`` observe, ``seen`` numbers each."""
        super().__init__()
        self.statistics = Statistics(agents * seen)

    def forward(self, obs: Tensor) -> Tensor:
        """Return them normalized, at most 5 deviations from the mean."""
        return self.statistics(_rows(obs)).clamp(-5.0, 5.0).reshape(obs.shape)

    def look(self, obs: Tensor) -> None:
        """Take more observations into the mean and the deviation."""
        self.statistics.look(_rows(obs))


def _rows(obs: Tensor) -> Tensor:
    return obs.flatten(-2).flatten(0, -2)


class Scaled(nn.Module):
    """Rewards by the deviation of what is earned from an episode's beginning, discounted.

    Were they as small as a task's first rewards are, the critic's errors would hide them.
    """

    def __init__(self, gamma: float) -> None:
        """Know no rewards yet."""
        super().__init__()
        self._gamma, self.statistics = gamma, Statistics(1)

    def forward(self, reward: Tensor) -> Tensor:
        """Look at whole episodes' rewards, (N, T, A, 1), and return them scaled."""
        earned = torch.zeros_like(reward[:, 0])
        totals: list[Tensor] = []
        for step in reward.unbind(1):
            earned = earned * self._gamma + step
            totals.append(earned)
        self.statistics.look(torch.cat(totals).reshape(-1, 1))
        return reward / (self.statistics.get_buffer("running_var") + 1e-8).sqrt()


class Networks(nn.Module):
    """An actor for each agent, and a critic of all; a checkpoint holds its state."""

    observed: Tensor

    def __init__(self, observed: Tensor, width: int, recipe: Recipe) -> None:
        """Draw weights.

        Args:
            observed: As `Arms.observed`, (A, D).
            width: How many numbers an agent does.
            recipe: Sizes of the networks.
        """
        super().__init__()
        agents, seen = observed.shape
        sizes: dict[str, Any] = {
            "depth": recipe.depth,
            "num_cells": recipe.width,
            "activation_class": nn.Tanh,
        }
        self.register_buffer("observed", observed)
        self.normalized = Normalized(agents, seen)
        self.scaled = Scaled(recipe.gamma)
        own = MultiAgentMLP(seen, width, agents, centralized=False, share_params=False, **sizes)
        for last in own.params[str(2 * recipe.depth)].values():
            last.data.mul_(0.01)  # arms stay near where they begin, and explore from there
        self.actors = nn.Sequential(
            self.normalized,
            own,
            AddStateIndependentNormalScale((agents, width), init_value=recipe.log_std),
        )
        self.critic = nn.Sequential(
            self.normalized,
            MultiAgentMLP(seen, 1, agents, centralized=True, share_params=True, **sizes),
        )

    def loss(self, recipe: Recipe) -> ClipPPOLoss:
        """Return PPO's loss, in which each agent's actions are clipped for themselves."""
        loss = ClipPPOLoss(
            ProbabilisticActor(
                TensorDictModule(self.actors, [OBSERVATION], [LOC, SCALE]),
                in_keys=[LOC, SCALE],
                out_keys=[ACTION],
                distribution_class=_Gaussian,
                default_interaction_type=InteractionType.RANDOM,
                return_log_prob=True,
            ),
            ValueOperator(self.critic, in_keys=[OBSERVATION], out_keys=[VALUE]),
            clip_epsilon=recipe.clip,
            entropy_bonus=False,
            loss_critic_type="l2",
            critic_coeff=0.5,
            normalize_advantage=True,
            normalize_advantage_exclude_dims=(-2,),
            functional=False,
        )
        loss.set_keys(
            value=VALUE, **{name: ("agents", name) for name in ("reward", "done", "terminated")}
        )
        loss.make_value_estimator(gamma=recipe.gamma, lmbda=recipe.gae_lambda)
        return loss


class MAPPOLearner(Learner):
    """Learns by PPO with an actor for each arm and a critic that sees all."""

    def __init__(self, recipe: Recipe, options: Namespace) -> None:
        """Make the environments to learn in."""
        self.task, self.making = options.task, making_of(options, recipe.control_mode)
        self._recipe, self._options = recipe, options
        self._arms = Arms(options.task, options.envs, options.workers, **self.making)
        self._episode = options.envs * get_task_class(options.task).max_episode_steps
        self.segment = recipe.every * self._episode

    def close(self) -> None:
        """Let the environments go."""
        self._arms.close()

    def begin(self, folder: Path) -> None:
        """Write policies that have learned nothing."""
        torch.manual_seed(self._options.seed)
        networks = self._networks()
        _write(networks, self._optimizer(networks, 0), folder)

    def learn(
        self, before: Path, after: Path, number: int, notice: Callable[[int], None]
    ) -> tuple[float, float]:
        """Learn from one checkpoint to the next; see `Learner`."""
        torch.set_num_threads(self._options.threads)
        seed = first_seed(self._options, number)
        torch.manual_seed(seed)
        self._arms.set_seed(seed)
        networks = self._networks()
        optimizer = self._optimizer(networks, number)
        _read(before, networks, optimizer)
        loss = networks.loss(self._recipe)
        rewards: list[float] = []
        ends: list[float] = []
        for iteration in range(self._recipe.every):
            with torch.no_grad():
                episodes = self._arms.rollout(10**6, loss.actor_network)
                rewards.append(float(episodes["next", REWARD].mean()))
                episodes["next", REWARD] = networks.scaled(episodes["next", REWARD])
                loss.value_estimator(episodes)
            ends.append(float(self._arms.succeeded.mean()))
            improve(loss, optimizer, episodes.reshape(-1), self._recipe)
            networks.normalized.look(episodes[OBSERVATION])
            notice((iteration + 1) * self._episode)
        _write(networks, optimizer, after)
        return float(np.mean(rewards)), float(np.mean(ends))

    def policy(self, folder: Path) -> LearnedPolicy:
        """Return the policy of a checkpoint."""
        return LearnedPolicy(folder, FILES, _loaded)

    def _networks(self) -> Networks:
        return Networks(
            self._arms.observed, self._arms.full_action_spec[ACTION].shape[-1], self._recipe
        )

    def _optimizer(self, networks: Networks, number: int) -> Adam:
        left = max(0.0, 1.0 - number * self.segment / self._options.steps)
        return Adam(networks.parameters(), self._recipe.learning_rate * left, eps=1e-5)


def improve(loss: ClipPPOLoss, optimizer: Adam, steps: TensorDictBase, recipe: Recipe) -> None:
    """Take the optimizer's steps for what was played, in batches drawn by chance."""
    shuffled = (torch.randperm(len(steps)).split(recipe.batch_size) for _ in range(recipe.epochs))
    for rows in chain.from_iterable(shuffled):
        losses = loss(steps[rows])
        optimizer.zero_grad()
        (losses["loss_objective"] + losses["loss_critic"]).backward()
        for part in (loss.actor_network, loss.critic_network):  # their losses differ in scale
            nn.utils.clip_grad_norm_(part.parameters(), recipe.max_grad_norm)
        optimizer.step()


def _write(networks: Networks, optimizer: Adam, folder: Path) -> None:
    state = {"networks": networks.state_dict(), "optimizer": optimizer.state_dict()["state"]}
    torch.save(state, folder / FILES[0])


def _read(folder: Path, networks: Networks, optimizer: Adam) -> None:
    state = torch.load(folder / FILES[0], weights_only=True)
    networks.load_state_dict(state["networks"])
    groups = optimizer.state_dict()["param_groups"]  # with the learning rate of now
    optimizer.load_state_dict({"state": state["optimizer"], "param_groups": groups})


@cache
def _loaded(path: Path) -> Callable[[Any], NDArray[np.float32]]:
    """Return a checkpoint's policy: observation (1, D) → action of all robots (A,)."""
    state = torch.load(path, weights_only=True)["networks"]
    width = state["actors.2.state_independent_scale"].shape[-1]
    networks = Networks(state["observed"], width, Recipe())
    networks.load_state_dict(state)

    def act(obs: Any) -> NDArray[np.float32]:
        with torch.no_grad():
            loc, _ = networks.actors(torch.as_tensor(obs)[:, networks.observed])
        return loc.flatten().clamp(-1.0, 1.0).numpy()

    return act


policy = LearnedPolicy(Path(os.environ.get("MAPPO_RUN", FOLDER)), FILES, _loaded)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the example.

    Args:
        arguments: Words of the command line; by default those of this process.

    Returns:
        0 if nine of ten test episodes succeed at the end, else 1.
    """
    options = read_arguments((__doc__ or "").splitlines()[0], FOLDER, arguments)
    recipe = Recipe()
    options.steps = options.steps or recipe.steps
    recipe = replace(recipe, every=options.every or recipe.every)
    settings = {"recipe": asdict(recipe), "torchrl": version("torchrl")}
    return main(options, lambda: MAPPOLearner(recipe, options), settings)


if __name__ == "__main__":  # the workers are processes of their own
    sys.exit(run())
