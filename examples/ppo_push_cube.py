"""Stable-Baselines3's PPO learns to push a cube onto a target, and its learning curve is drawn.

    pip install 'robot-layouts[sb3,preview]'
    python examples/ppo_push_cube.py

It learns in worker processes, on the processor, from the task's dense reward, and is examined on
seeds that it never learns from. It leaves the policy, how observations are normalised for it, the
curve, and the curve's numbers.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

import tasks
from robot_layouts.core.progress import Progress
from robot_layouts.data.log import HOW, Log, opened_log
from robots import RobotLayoutsError

TASK = "PushCube-v1"
EPISODE = 50  # steps
TEST_SEED = 1_000_000  # of the first test episode; the others follow
EXAMINED_EVERY = 20_000  # steps of all environments together

LEARNING_RATE = 7e-4  # at first; it falls to 0
# Dense rewards are near, hence the small discount. It must still look beyond the few steps in which
# the gripper gets from before the cube to behind it: with 0.8 it often did not learn to.
HYPERPARAMETERS: dict[str, Any] = {
    "n_steps": 25,
    "batch_size": 400,
    "n_epochs": 8,
    "gamma": 0.9,
    "gae_lambda": 0.95,
    "target_kl": 0.1,
    "policy_kwargs": {"net_arch": [256, 256], "log_std_init": -1.0},
}


@dataclass(frozen=True)
class Examination:
    """How well a policy does, without noise, on the test seeds.

    Attributes:
        steps: Steps that it has learned from.
        seconds: Time that it has learned for.
        success: Share of episodes that succeed.
        success_at_end: Share of episodes whose cube is on the target at their last step too.
        reward: Mean reward of a step, from 0 to 1.
    """

    steps: int
    seconds: float
    success: float
    success_at_end: float
    reward: float


class Examiner(BaseCallback):
    """Examines the policy now and then while it learns.

    Attributes:
        curve: What it found, in order.
    """

    def __init__(self, env: VecEnv, line: Progress, log: Log) -> None:
        """Take the environments to examine it in, one per test seed, and where to say how it is."""
        super().__init__()
        self.curve: list[Examination] = []
        self._env, self._line, self._log = env, line, log
        self._learned, self._since = 0.0, 0.0

    def _on_training_start(self) -> None:
        self._since = time.perf_counter()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= len(self.curve) * EXAMINED_EVERY:
            self.examine()

    def _on_step(self) -> bool:
        self._line.update(self.num_timesteps, "learning")
        return True

    def examine(self) -> None:
        """Add an examination to the curve, and tell what came out."""
        self._learned += time.perf_counter() - self._since
        found = examine(self.model, self._env, self.num_timesteps, round(self._learned, 1))
        self.curve.append(found)
        self._log(found.steps, {n: v for n, v in asdict(found).items() if n != "steps"})
        self._line.say(
            f"{found.steps:>7} steps  {found.seconds:>5.0f} s  success {found.success:>4.0%}"
            f"  reward {found.reward:.2f}"
        )
        self._since = time.perf_counter()


def examine(model: BaseAlgorithm, env: VecEnv, steps: int, seconds: float) -> Examination:
    """Let a policy play one episode of every test seed, to its last step."""
    env.seed(TEST_SEED)
    obs: Any = env.reset()
    succeeded = np.zeros((EPISODE, env.num_envs), bool)
    rewards = np.zeros((EPISODE, env.num_envs))
    for step in range(EPISODE):
        action, _ = model.predict(obs, deterministic=True)
        obs, rewards[step], _, infos = env.step(action)
        succeeded[step] = [info["is_success"] for info in infos]
    return Examination(
        steps,
        seconds,
        success=float(succeeded.any(axis=0).mean()),
        success_at_end=float(succeeded[-1].mean()),
        reward=round(float(rewards.mean()), 4),
    )


def learn(options: argparse.Namespace) -> list[Examination]:
    """Learn, save the policy, and return its learning curve.

    Success ends an episode of this task, and with it the rewards. Were that so while it learns,
    the policy would rather wait beside the target; hence ``ignore_terminations``.
    """

    def make(num_envs: int) -> VecNormalize:
        env = tasks.sb3_vec_env(TASK, num_envs, options.workers, ignore_terminations=True)
        return VecNormalize(env, norm_reward=False, clip_obs=5.0)

    torch.set_num_threads(options.threads)
    line = Progress(options.steps)
    with (
        opened_log(options.log) as log,
        closing(make(options.envs)) as env,
        closing(make(options.tests)) as tests,
        line,
    ):
        tests.training, tests.obs_rms = False, env.obs_rms
        examiner = Examiner(tests, line, log)
        rate = LinearSchedule(LEARNING_RATE, 0.0, 1.0)
        model = PPO("MlpPolicy", env, rate, seed=options.seed, device="cpu", **HYPERPARAMETERS)
        model.learn(options.steps, callback=examiner)
        examiner.examine()
        model.save(options.out / "policy.zip")
        env.save(str(options.out / "normalization.pkl"))
    return examiner.curve


def draw(curve: Sequence[Examination], path: Path) -> None:
    """Save the learning curve as a picture."""
    steps = [found.steps / 1000 for found in curve]
    figure = Figure(figsize=(7, 4), dpi=110, layout="constrained")
    success = figure.add_subplot()
    success.plot(steps, [100 * found.success for found in curve], "o-", color="#0072B2")
    success.set(ylim=(0, 102), xlabel="steps (thousands)")
    success.set_ylabel("success on test seeds (%)", color="#0072B2")
    success.grid(alpha=0.3)
    reward = success.twinx()
    reward.plot(steps, [found.reward for found in curve], "s--", color="#D55E00")
    reward.set(ylim=(0, 1.02))
    reward.set_ylabel("mean reward of a step", color="#D55E00")
    success.set_title(f"PPO on {TASK}")
    figure.savefig(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the example.

    Args:
        arguments: Words of the command line; by default those of this process.

    Returns:
        0 if nine of ten test episodes succeed at the end, else 1.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--steps", type=int, default=200_000, help="steps to learn from (default %(default)s)")
    add("--envs", type=int, default=64, help="environments to learn in (default %(default)s)")
    add("--tests", type=int, default=50, help="test episodes (default %(default)s)")
    add("--workers", type=int, help="processes (default: one per core)")
    add("--threads", type=int, default=1, help="threads that learn (default %(default)s)")
    add("--seed", type=int, default=0, help="of the policy and of the episodes (default 0)")
    add("--out", type=Path, default=Path("runs/ppo_push_cube"), help="folder (default %(default)s)")
    add("--log", help=f"also log the curve: {HOW}")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        curve = learn(options)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    numbers = {
        "task": TASK,
        "seed": options.seed,
        "environments": options.envs,
        "test_seeds": [TEST_SEED, TEST_SEED + options.tests - 1],
        "hyperparameters": {"learning_rate": LEARNING_RATE, **HYPERPARAMETERS},
        "curve": [asdict(found) for found in curve],
    }
    (options.out / "learning_curve.json").write_text(json.dumps(numbers, indent=2) + "\n")
    draw(curve, options.out / "learning_curve.png")
    print(f"{curve[-1].success:.0%} of {options.tests} test episodes succeed; see {options.out}")
    return 0 if curve[-1].success >= 0.9 else 1


if __name__ == "__main__":  # the workers are processes of their own
    sys.exit(main())
