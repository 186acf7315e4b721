"""Many worlds of a task as one torchrl environment, in which every arm is an agent."""

# torchrl need not be installed where types are checked.
# pyright: reportMissingImports=false, reportUntypedBaseClass=false
# pyright: reportUnknownParameterType=false

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

import tasks
from robots import TaskError

# What tensors are called: those of agents are together under "agents".
OBSERVATION, ACTION, REWARD = (("agents", name) for name in ("observation", "action", "reward"))
FLAGS = ("done", "terminated", "truncated")


class Arms(EnvBase):
    """Many worlds at once, in worker processes, with the agents of `tasks.parallel_env`.

    torchrl's own wrapper of PettingZoo steps one world at a time, at a quarter of the speed.

    Attributes:
        observed: Agent → which numbers of the flat observation it observes, (A, D).
        succeeded: In which worlds the last step was a success, (N,).
    """

    def __init__(self, task: str, num_envs: int, num_workers: int | None, **making: Any) -> None:
        """Start the workers, and ask a PettingZoo environment what each agent observes.

        Args:
            task: The task's id.
            num_envs: Number of worlds.
            num_workers: Number of processes; None takes one per core, 0 this process.
            making: Other arguments of `tasks.make`.

        Raises:
            TaskError: If the agents differ in how much they observe or do.
        """
        super().__init__(batch_size=torch.Size([num_envs]))
        pair = tasks.parallel_env(task, **making)
        rows = [pair.observed[agent] for agent in pair.possible_agents]
        sizes = [gymnasium.spaces.flatdim(space) for space in pair.action_spaces.values()]
        pair.close()
        if len({len(row) for row in rows}) > 1 or len(set(sizes)) > 1:
            raise TaskError(
                f"{task}: agents {', '.join(pair.possible_agents)} observe"
                f" {', '.join(str(len(row)) for row in rows)} numbers and do"
                f" {', '.join(map(str, sizes))}; MultiAgentMLP needs as many for each"
            )
        self.observed = torch.tensor(np.array(rows))
        self._agents = len(rows)
        self._vector = gymnasium.make_vec(
            f"RobotLayouts/{task}",
            num_envs=num_envs,
            num_workers=num_workers,
            autoreset_mode="DISABLED",
            ignore_terminations=True,
            **making,
        )
        self._first_seed: int | None = None
        self._declare(sizes[0])

    def _declare(self, width: int) -> None:
        """Say what agents observe, do and earn; torchrl calls these specs."""
        agents = torch.Size([self.num_envs, self._agents])
        seen, done, one = (
            torch.Size([*agents, size]) for size in (self.observed.shape[1], width, 1)
        )

        def of_agents(**parts: Any) -> Composite:
            return Composite(agents=Composite(parts, shape=agents), shape=self.batch_size)

        self.observation_spec = of_agents(observation=Unbounded(seen))
        self.action_spec = of_agents(action=Bounded(-1.0, 1.0, done))
        self.reward_spec = of_agents(reward=Unbounded(one))
        self.done_spec = of_agents(**{n: Categorical(2, one, dtype=torch.bool) for n in FLAGS})

    @property
    def num_envs(self) -> int:
        """Number of worlds N."""
        return self.batch_size[0]

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        """Begin an episode in every world; after `set_seed` in worlds that are built anew."""
        seed, self._first_seed = self._first_seed, None
        obs, _ = self._vector.reset(seed=seed, options={"reconfigure": seed is not None})
        return self._of_agents(observation=self._seen(obs))

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        action: Tensor = tensordict[ACTION].flatten(1)
        obs, reward, terminated, truncated, info = self._vector.step(action.clamp(-1, 1).numpy())
        self.succeeded: NDArray[np.bool_] = info["success"]
        flags = {
            "terminated": terminated,
            "truncated": truncated,
            "done": terminated | truncated,
        }
        shared = {name: self._for_each(column) for name, column in flags.items()}
        return self._of_agents(observation=self._seen(obs), reward=self._for_each(reward), **shared)

    def _set_seed(self, seed: int | None) -> None:
        self._first_seed = seed

    def _for_each(self, column: NDArray[Any]) -> Tensor:
        """Give every agent what is a world's, (N,) → (N, A, 1)."""
        return torch.from_numpy(column)[:, None, None].expand(-1, self._agents, 1).clone()

    def _seen(self, obs: NDArray[np.float32]) -> Tensor:
        """Return what each agent observes, (N, A, D)."""
        return torch.from_numpy(obs)[:, self.observed]

    def _of_agents(self, **parts: Tensor) -> TensorDict:
        agents = TensorDict(parts, batch_size=(self.num_envs, self._agents))
        return TensorDict({"agents": agents}, batch_size=self.batch_size)

    def close(self, **_: Any) -> None:
        """End the workers."""
        if not self.is_closed:
            self._vector.close()
            self.is_closed = True
