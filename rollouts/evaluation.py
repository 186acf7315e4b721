"""How well a policy does: whole episodes of a task, in worker processes or in this one."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass
from math import fsum
from statistics import mean
from typing import Any

import numpy as np
import torch

from experts import find_expert
from experts.registry import Expert
from robots import TaskError
from rollouts.playing.executor import (
    EPISODE_SECONDS,
    Event,
    Executor,
    choose_executor,
    modules_of,
    play_all,
)
from rollouts.playing.plan_conversion import Planner
from rollouts.playing.seeds import checked_seeds
from tasks import MultiRobotTask, Scenario, get_task_class
from tasks.episode import Policy, Score, follow, moments
from tasks.registry import make_scenario

EXPERT = "expert"

_SHOWN = 10  # seeds that a text names


@dataclass(frozen=True)
class Evaluation:
    """How episodes of a task went, by seed.

    Attributes:
        task: The task's id.
        policy: Who played, in words.
        scores: Seed → how its episode went, in the order in which the seeds were given.
    """

    task: str
    policy: str
    scores: Mapping[int, Score]

    @property
    def success_rate(self) -> float:
        """The share of episodes that ended in success."""
        return mean(self.successes.values())

    @property
    def successes(self) -> dict[int, bool]:
        """Seed → whether the episode ended in success."""
        return {seed: score.success for seed, score in self.scores.items()}

    @property
    def returns(self) -> dict[int, float]:
        """Seed → sum of rewards."""
        return {seed: score.total for seed, score in self.scores.items()}

    @property
    def lengths(self) -> dict[int, int]:
        """Seed → control steps."""
        return {seed: score.steps for seed, score in self.scores.items()}

    def __str__(self) -> str:
        """Return it as a few lines."""
        failed = [seed for seed, success in self.successes.items() if not success]
        lines = [
            f"{self.task}, {self.policy}: {len(self.scores) - len(failed)} of {len(self.scores)}"
            f" episodes with success ({self.success_rate:.1%})",
            "on average: return {:.2f} ({:.4g} to {:.4g})".format(*_spread(self.returns))
            + ", {:.1f} steps ({} to {})".format(*_spread(self.lengths)),
        ]
        if failed:
            more = f" and {len(failed) - _SHOWN} more" if len(failed) > _SHOWN else ""
            lines.append(f"no success: seeds {', '.join(map(str, failed[:_SHOWN]))}{more}")
        return "\n".join(lines)


def evaluate(
    policy: Policy | str,
    task: str,
    seeds: Sequence[int],
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
    on_event: Callable[[Event], None] = lambda event: None,
    **making: Any,
) -> Evaluation:
    """Let a policy play the episodes of some seeds, and tell how they went.

    What comes out depends on nothing but the policy, the task and the seeds: every episode is
    played in a world built anew by a copy of the policy as it was passed, and the random
    generators of Python, NumPy and torch start from its seed. An episode ends with the first step
    that is terminated or truncated.

    Args:
        policy: Maps the observation, (1, D) float32 if ``obs_mode`` is ``"state"``, to the action,
            (A,) or (1, A). It can be pickled, unless ``workers`` is 0; what `copy.deepcopy` does
            not copy, such as a function, is not copied for each episode. Or ``"expert"``, which
            makes a plan for each seed and carries it out; where it finds none, the episode is a
            failure of 0 steps.
        task: Id of the task.
        seeds: Which episodes, each once.
        workers: How many processes play; None: one for each core that this process may use; 0:
            none, but this one.
        executor: Who plays instead, such as `rollouts.playing.ray_executor.RayExecutor`.
        episode_timeout: Seconds that an episode may take in a worker until that is ended and the
            episode played again, three times in all; None if it may take for ever.
        on_event: Called with each event of the executor, to show progress.
        making: Arguments of `tasks.make`, such as ``robots`` and ``obs_mode``.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that or has no expert, a number makes no sense,
            or there are no seeds or one is there twice.
        WorkerError: If the policy raised something, cannot be sent to the workers, or they die of
            it again and again.
    """
    executor = choose_executor(workers, executor, episode_timeout)
    cls, seeds = get_task_class(task), checked_seeds(seeds)
    if not seeds:
        raise TaskError("no seeds were given; an evaluation plays one or more")
    name, scenario = _name(policy), make_scenario(cls, **making)
    if scenario.num_envs != 1:
        raise TaskError(f"num_envs is {scenario.num_envs}; an evaluation plays 1 in each worker")
    scenario.check(cls.reward_modes)
    if callable(policy):
        job = EvaluationJob(cls, scenario, policy)
    else:
        job = EvaluationJob(cls, scenario, expert=find_expert(cls.task_id))
    scores: dict[int, Score] = {}
    with closing(play_all(executor, job, seeds)) as events:
        for event in events:
            on_event(event)
            if event.error is not None:
                event.error.args = (f"seed {event.seed}: {event.error}", *event.error.args[1:])
                raise event.error
            if event.seed is not None and isinstance(event.result, Score):
                scores[event.seed] = event.result
    return Evaluation(cls.task_id, name, {seed: scores[seed] for seed in seeds})


@dataclass(frozen=True)
class EvaluationJob:
    """Everything but the seed that decides an episode; can be pickled.

    Attributes:
        task: Class of the task.
        scenario: How to make it.
        policy: Who plays, a `Policy`; None if the expert does.
        expert: An expert, or None.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    policy: Any = None
    expert: Expert | None = None

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task, self.policy, self.expert)

    def __call__(self) -> Callable[[int], Score]:
        """Make the task in a worker, and return what plays the episode of a seed."""
        torch.set_num_threads(1)  # as many everywhere, so that sums are the same
        return _Player(self)


class _Player:
    """Plays episodes in one world, which is built anew for each."""

    def __init__(self, job: EvaluationJob) -> None:
        self._env, self._policy = job.task(job.scenario), job.policy
        self._planner = None if job.expert is None else Planner(self._env, job.expert)

    def __call__(self, seed: int) -> Score:
        """Play the episode of a seed."""
        random.seed(seed)
        np.random.seed(seed)
        torch.manual_seed(seed)
        if self._planner is None:
            return _play(self._env, seed, deepcopy(self._policy), self._env.max_episode_steps)
        try:
            plan = self._planner(seed)
        except TaskError:
            return Score(False, 0.0, 0)
        return _play(self._env, seed, follow(plan), len(plan))

    def close(self) -> None:
        """Let the worlds go."""
        self._env.close()
        if self._planner is not None:
            self._planner.close()


def _play(env: MultiRobotTask, seed: int, policy: Policy, most: int) -> Score:
    """Play an episode of at most so many steps."""
    rewards: list[float] = []
    success = False
    with torch.no_grad(), closing(moments(env, seed, policy, most)) as happening:
        next(happening)
        for moment in happening:
            rewards.append(moment.reward)
            success = moment.success
            if moment.terminated or moment.truncated:
                break
    return Score(success, fsum(rewards), len(rewards))


def _name(policy: Policy | str) -> str:
    """Return who plays, in words.

    Raises:
        TaskError: If it is nobody.
    """
    if isinstance(policy, str) and policy == EXPERT:
        return EXPERT
    if not callable(policy):
        raise TaskError(
            f"policy is {policy!r}; it must be callable, obs → action, or the word {EXPERT!r}"
        )
    return getattr(policy, "__qualname__", type(policy).__qualname__)


def _spread(by_seed: Mapping[int, float]) -> tuple[float, float, float]:
    """Return mean, smallest and largest."""
    values = by_seed.values()
    return mean(values), min(values), max(values)
