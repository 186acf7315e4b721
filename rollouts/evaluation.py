"""How well a policy does: whole episodes of a task, in worker processes or in this one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from statistics import mean
from typing import TYPE_CHECKING, NoReturn

import torch

from experts import find_expert
from robots import TaskError
from robots.common.bounds import checked_whole
from rollouts.playing.casting import Cast, Casting
from rollouts.playing.executor import (
    EPISODE_SECONDS,
    Event,
    Executor,
    choose_executor,
    modules_of,
    play_all,
)
from rollouts.playing.seeds import checked_seeds
from rollouts.playing.together import grouped, one_by_one, play_together
from rollouts.sources.policies import EXPERT, check_policy
from tasks import MultiRobotTask, Scenario, get_task_class
from tasks.episode import Policy, Score
from tasks.registry import make_scenario

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tasks.engine.making import MakingFields

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
    def reasons(self) -> dict[int, str]:
        """Seed → why the episode failed, for those of which that is known: an expert's."""
        return {seed: score.reason for seed, score in self.scores.items() if score.reason}

    @property
    def lengths(self) -> dict[int, int]:
        """Seed → control steps."""
        return {seed: score.steps for seed, score in self.scores.items()}

    def __repr__(self) -> str:
        """Show it as a few lines."""
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
        reasons = list(self.reasons.items())
        lines += [f"seed {seed}: {reason}" for seed, reason in reasons[:_SHOWN]]
        return "\n".join(lines)


def evaluate(
    policy: Policy | str,
    task: str,
    seeds: Sequence[int],
    *,
    num_envs: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
    on_event: Callable[[Event], None] = lambda event: None,
    **making: Unpack[MakingFields],
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
            failure of 0 steps, whose reason is given.
        task: Id of the task.
        seeds: Which episodes, each once.
        num_envs: How many episodes each process plays at once, in environments of one task. The
            policy is called, and copied, for each as if that were alone, so that the scores are
            those of 1. A policy whose attribute ``batched`` is True is called once for all that
            are running, observations (n, D) → actions (n, A), which is faster; it is neither
            copied nor are its random numbers those of each seed.
        workers: How many processes play; None: one for each core that this process may use; 0:
            none, but this one.
        executor: Who plays instead, such as `rollouts.playing.ray_executor.RayExecutor`.
        episode_timeout: Seconds that an episode, or those played at once, may take in a worker
            until that is ended and they are played again, three times in all; None if they may
            take for ever.
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
    checked_whole("num_envs", num_envs, 1, None, TaskError)
    num_envs = min(num_envs, len(seeds))
    name, scenario = _name(policy), make_scenario(cls, num_envs, **making)
    scenario.check(cls.reward_modes)
    together = grouped(seeds, num_envs)
    expert = find_expert(cls.task_id) if isinstance(policy, str) else None
    cast = Cast(None if expert else policy, expert)
    job = EvaluationJob(cls, scenario, cast, together)
    scores: dict[int, Score] = {}
    with closing(play_all(executor, job, list(together))) as events:
        for event in events:
            for single in one_by_one(event):
                on_event(single)
                if single.seed is not None and isinstance(single.result, Score):
                    scores[single.seed] = single.result
            if event.error is not None:
                _raise(event.error, [event.seed] if event.seed is None else together[event.seed])
    return Evaluation(cls.task_id, name, {seed: scores[seed] for seed in seeds})


def _raise(error: Exception, seeds: Sequence[int | None]) -> NoReturn:
    """Raise an error that says at which seeds it happened."""
    which = (
        f"seed {seeds[0]}" if len(seeds) == 1 else f"one of the seeds {', '.join(map(str, seeds))}"
    )
    error.args = (f"{which}: {error}", *error.args[1:])
    raise error


@dataclass(frozen=True)
class EvaluationJob:
    """Everything but the seed that decides an episode; can be pickled.

    Attributes:
        task: Class of the task.
        scenario: How to make it.
        cast: Who plays.
        together: Seeds that are played at once, by the first of them.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    cast: Cast
    together: Mapping[int, tuple[int, ...]] = field(default_factory=dict[int, tuple[int, ...]])

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task, *self.cast.members)

    def __call__(self) -> Callable[[int], dict[int, Score]]:
        """Make the task in a worker, and return what plays the episodes of a seed and others."""
        torch.set_num_threads(1)  # as many everywhere, so that sums are the same
        return _Play(self)


class _Play:
    """Plays episodes in the worlds of one task, which are built anew for each."""

    def __init__(self, job: EvaluationJob) -> None:
        self._together, self._env = job.together, job.task(job.scenario)
        self._casting = Casting(job.cast, self._env)

    def __call__(self, seed: int) -> dict[int, Score]:
        """Play the episodes of a seed and of those that are played together with it."""
        players = [self._casting(seed) for seed in self._together[seed]]
        with torch.no_grad():
            play_together(self._env, players)
        return {player.seed: player.score for player in players}

    def close(self) -> None:
        """Let the worlds go."""
        self._env.close()
        self._casting.close()


def _name(policy: Policy | str) -> str:
    """Return who plays, in words.

    Raises:
        TaskError: If it is nobody.
    """
    if isinstance(policy, str) and policy == EXPERT:
        return EXPERT
    check_policy(policy)
    return getattr(policy, "__qualname__", type(policy).__qualname__)


def _spread(by_seed: Mapping[int, float]) -> tuple[float, float, float]:
    """Return mean, smallest and largest."""
    values = by_seed.values()
    return mean(values), min(values), max(values)
