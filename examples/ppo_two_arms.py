"""Stable-Baselines3's PPO learns what one arm or several shall do, with one policy for all.

    pip install 'robot-layouts[sb3,preview]'
    python examples/ppo_two_arms.py                       # TwoRobotPickCube, in hours
    python examples/ppo_two_arms.py --task PushCube-v1 --out runs/push    # in minutes

It learns in worker processes, on the processor, from the task's dense reward, and is examined on
seeds that it never learns from. Two runs give the same weights, and so does one that is killed and
started again. What it learned is a policy that can be imported:

    PYTHONPATH=examples robot-layouts evaluate --policy ppo_two_arms:policy \
        --task TwoRobotPickCube-v1 --control-mode pd_ee_delta_pos
"""

from __future__ import annotations

import os
import pickle
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from learning_runs import LearnedPolicy, Learner, first_seed, main, making_of, read_arguments
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import tasks

FOLDER = "runs/ppo_two_arms"
FILES = ("policy.zip", "normalization.pkl")


# Dense rewards are near, hence the small discount. It must still look beyond the few steps in which
# a gripper gets from before a cube to behind it: with 0.8, PushCube was often not learned.
HYPERPARAMETERS: dict[str, Any] = {
    "n_steps": 100,  # an episode
    "batch_size": 800,
    "n_epochs": 4,
    "gamma": 0.9,
    "gae_lambda": 0.95,
    "target_kl": 0.1,
    "policy_kwargs": {"net_arch": [256, 256], "log_std_init": -1.0},
}


@dataclass(frozen=True)
class Recipe:
    """How a task is learned.

    Attributes:
        steps: Steps to learn from.
        control_mode: What actions mean.
        learning_rate: At first; it falls to 0.
        every: Iterations between two checkpoints.
        hyperparameters: Stable-Baselines3's, of PPO.
        normalization: Stable-Baselines3's, of observations and rewards.
    """

    steps: int = 16_000_000
    control_mode: str = "pd_ee_delta_pos"
    learning_rate: float = 3e-4
    every: int = 40
    hyperparameters: dict[str, Any] = field(default_factory=lambda: HYPERPARAMETERS)
    normalization: dict[str, Any] = field(default_factory=lambda: {"gamma": 0.9})


RECIPES = {
    "PushCube-v1": Recipe(
        steps=200_000,
        control_mode="pd_joint_delta_pos",
        learning_rate=7e-4,
        every=12,
        hyperparameters={**HYPERPARAMETERS, "n_steps": 25, "batch_size": 400, "n_epochs": 8},
        normalization={"norm_reward": False, "clip_obs": 5.0},
    ),
}


class PPOLearner(Learner):
    """Learns by PPO over the flat action of all robots."""

    def __init__(self, recipe: Recipe, options: Namespace) -> None:
        """Make the environments to learn in."""
        self.task, self.making = options.task, making_of(options, recipe.control_mode)
        self._recipe, self._options = recipe, options
        self._env = tasks.sb3_vec_env(
            options.task, options.envs, options.workers, ignore_terminations=True, **self.making
        )
        iteration = options.envs * recipe.hyperparameters["n_steps"]
        self.segment = recipe.every * iteration
        batch_size = min(iteration, recipe.hyperparameters["batch_size"])
        self._hyperparameters = {**recipe.hyperparameters, "batch_size": batch_size}

    def close(self) -> None:
        """Let the environments go."""
        self._env.close()

    def begin(self, folder: Path) -> None:
        """Write a policy that has learned nothing."""
        torch.set_num_threads(self._options.threads)
        env = VecNormalize(VecMonitor(self._env), **self._recipe.normalization)
        model = PPO(
            "MlpPolicy", env, seed=self._options.seed, device="cpu", **self._hyperparameters
        )
        _write(model, env, folder)

    def learn(
        self, before: Path, after: Path, number: int, notice: Callable[[int], None]
    ) -> tuple[float, float]:
        """Learn from one checkpoint to the next; see `Learner`.

        Success ends an episode, and with it the rewards. Were that so while it learns, the policy
        would rather wait beside the goal; hence ``ignore_terminations``.
        """
        torch.set_num_threads(self._options.threads)
        env = VecNormalize.load(str(before / FILES[1]), VecMonitor(self._env))
        left = max(0.0, 1 - number * self.segment / self._options.steps)
        rate = self._recipe.learning_rate * left
        model = PPO.load(before / FILES[0], env, device="cpu", learning_rate=rate)
        model.set_random_seed(first_seed(self._options, number))
        env.set_options({"reconfigure": True})
        rewards: list[float] = []
        ends: list[bool] = []

        def on_step(names: dict[str, Any], _: dict[str, Any]) -> bool:
            rewards.append(float(env.get_original_reward().mean()))
            infos = zip(names["infos"], names["dones"], strict=True)
            ends.extend(info["is_success"] for info, done in infos if done)
            notice(len(rewards) * env.num_envs)
            return True

        model.learn(self.segment, callback=on_step, reset_num_timesteps=False)
        _write(model, env, after)
        return float(np.mean(rewards)), float(np.mean(ends or [False]))

    def policy(self, folder: Path) -> LearnedPolicy:
        """Return the policy of a checkpoint."""
        return LearnedPolicy(folder, FILES, _loaded)


def _write(model: PPO, env: VecNormalize, folder: Path) -> None:
    model.save(folder / FILES[0])
    env.save(str(folder / FILES[1]))


@cache
def _loaded(policy: Path, normalization: Path) -> Callable[[Any], NDArray[np.float32]]:
    """Return a checkpoint's policy: observation (1, D) → action of all robots (A,)."""
    model, known = PPO.load(policy, device="cpu"), pickle.loads(normalization.read_bytes())

    def act(obs: Any) -> NDArray[np.float32]:
        return model.predict(known.normalize_obs(np.asarray(obs)), deterministic=True)[0][0]

    return act


policy = LearnedPolicy(Path(os.environ.get("PPO_RUN", FOLDER)), FILES, _loaded)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the example.

    Args:
        arguments: Words of the command line; by default those of this process.

    Returns:
        0 if nine of ten test episodes succeed at the end, else 1.
    """
    options = read_arguments((__doc__ or "").splitlines()[0], FOLDER, arguments)
    recipe = RECIPES.get(options.task, Recipe())
    options.steps = options.steps or recipe.steps
    recipe = replace(recipe, every=options.every or recipe.every)
    made_by = {"recipe": asdict(recipe), "stable-baselines3": version("stable-baselines3")}
    return main(options, lambda: PPOLearner(recipe, options), made_by)


if __name__ == "__main__":  # the workers are processes of their own
    sys.exit(run())
