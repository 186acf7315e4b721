"""How well a policy does: whole episodes of a task, in worker processes or in this one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from errno import EISDIR
from os import PathLike
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.writing import writing_errors
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.playing.evaluation_job import (
    EvaluationJob,
    TracedScore,
    WatchedPictures,
    scores_of,
)
from robot_layouts.data.playing.executor import (
    Executor,
    checked_seeds,
    choose_executor,
    seed_lines,
    wait_lines,
)
from robot_layouts.data.playing.scheduler import EPISODE_SECONDS, Event
from robot_layouts.data.playing.served.policy import ServedPolicy
from robot_layouts.data.playing.shared_policy import SharedPolicy
from robot_layouts.data.playing.together import Cast, cast_of, grouped
from robot_layouts.data.receipts.pictures import keep, pictures_folder
from robot_layouts.data.receipts.provenance import describe_job, receipt_of
from robot_layouts.data.receipts.receipt import Receipt
from robots import TaskError
from tasks.engine.observation import read_mode
from tasks.episode import Policy, Score
from tasks.registry import scenario_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tasks import TaskEnv
    from tasks.engine.scenario import MakingFields


@dataclass(frozen=True)
class Evaluation:
    """How episodes of a task went, by seed.

    Attributes:
        task: The task's id.
        policy: Who played, in words.
        scores: Seed → how its episode went, in the order in which the seeds were given.
        receipt: The receipt, if one was asked for.
    """

    task: str
    policy: str
    scores: Mapping[int, Score]
    receipt: Receipt | None = field(default=None, compare=False)

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
    def stage_scores(self) -> dict[int, float]:
        """Seed → score of the last stage that the episode passed; empty of a task without stages.

        An episode of no steps has passed none.
        """
        found = {seed: score.stage_score for seed, score in self.scores.items()}
        if all(score is None for score in found.values()):
            return {}
        return {seed: score or 0.0 for seed, score in found.items()}

    @property
    def waits(self) -> tuple[float, ...]:
        """How long each answer of the policy's server took (s); empty if none serves it."""
        return tuple(wait for score in self.scores.values() for wait in score.waits)

    @property
    def lengths(self) -> dict[int, int]:
        """Seed → control steps."""
        return {seed: score.steps for seed, score in self.scores.items()}

    def __repr__(self) -> str:
        """Show it as a few lines."""
        failed = {seed: score.reason for seed, score in self.scores.items() if not score.success}
        lines = [
            f"{self.task}, {self.policy}: {len(self.scores) - len(failed)} of {len(self.scores)}"
            f" episodes with success ({self.success_rate:.1%})",
            "on average: return {:.2f} ({:.4g} to {:.4g})".format(*_spread(self.returns))
            + ", {:.1f} steps ({} to {})".format(*_spread(self.lengths)),
        ]
        if self.stage_scores:
            lines[-1] += ", stage score {:.2f} ({:.2f} to {:.2f})".format(
                *_spread(self.stage_scores)
            )
        return "\n".join([*lines, *wait_lines(self.waits), *seed_lines("no success", failed)])


def evaluate(
    policy: Policy | str,
    task: str | TaskEnv,
    seeds: Sequence[int],
    *,
    num_envs: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
    receipt: str | PathLike[str] | None = None,
    picture_interval: int = 1,
    keep_pictures: bool = False,
    on_event: Callable[[Event], None] = lambda event: None,
    **making: Unpack[MakingFields],
) -> Evaluation:
    """Let a policy play the episodes of some seeds, and tell how they went.

    What comes out depends on nothing but the policy, the task and the seeds: every episode is
    played in a world built anew by a copy of the policy as it was passed, and the random
    generators of Python, NumPy and torch start from its seed. An episode ends with the first step
    that is terminated or truncated. An episode in which physics diverges is a failure that ends
    with the step before, and its reason says so; where several were played at once, each is
    played again alone.

    Args:
        policy: Maps the observation, (1, D) float32 if ``obs_mode`` is ``"state"``, to the action,
            (A,) or (1, A). It can be pickled, unless ``workers`` is 0; what `copy.deepcopy` does
            not copy, such as a function, is not copied for each episode. Or where one is imported
            from, ``"module:name"``. Or where one is served, ``"ws://host:port"``; see
            `robot_layouts.data.playing.served.policy.ServedPolicy`. Or ``"hub:OWNER/NAME"``; see
            `robot_layouts.data.playing.shared_policy`. Or ``"expert"``, which makes a plan for each
            seed and carries it out; where it finds none, the episode is a failure of 0 steps, whose
            reason is given.
        task: Id of the task, or an environment of it, as which every episode is made.
        seeds: Which episodes, each once.
        num_envs: How many episodes each process plays at once, in environments of one task. The
            policy is called, and copied, for each as if that were alone, so that the scores are
            those of 1. A policy whose attribute ``batched`` is True is called once for all that
            are running, observations (n, D) → actions (n, A), which is faster; it is neither
            copied nor are its random numbers those of each seed.
        workers: How many processes play; None: one for each core that this process may use; 0:
            none, but this one.
        executor: Who plays instead, such as `robot_layouts.data.playing.ray_executor.RayExecutor`.
        episode_timeout: Seconds that an episode, or those played at once, may take in a worker
            until that is ended and they are played again, three times in all; None if they may
            take for ever.
        receipt: File to write a receipt to, json that `verify` plays again.
        picture_interval: If pictures are observed, the receipt has a digest of those after the
            reset and after each so many-th control step.
        keep_pictures: Whether to keep these pictures, in the folder NAME.pictures beside the
            receipt NAME.json: `verify` shows them beside those that differ.
        on_event: Called with each event of the executor, to show progress.
        making: Arguments of `tasks.make`, such as ``robots`` and ``obs_mode``, if ``task`` is an
            id.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that or has no expert, a number is out
            of range, there are no seeds, or one is given twice.
        UnwritableFileError: If the receipt or its pictures cannot be written.
        AssetError: If the receipt needs robot files that cannot be found.
        ReceiptError: If it needs files of the policy that cannot be read.
        WorkerError: If the policy raised something, cannot be sent to the workers, or they die of
            it again and again.
        HubError: If the policy cannot be read from the Hub.
        PolicyServerError: If the policy's server cannot be reached, is silent, or answers what is
            no action.
    """
    executor = choose_executor(workers, executor, episode_timeout)
    seeds = checked_seeds(seeds)
    if not seeds:
        raise TaskError("no seeds were given; an evaluation plays one or more")
    checked_whole("num_envs", num_envs, 1, None, TaskError)
    checked_whole("picture_interval", picture_interval, 1, None, TaskError)
    if receipt is None and (keep_pictures or picture_interval != 1):
        raise TaskError("pictures belong to a receipt; give the file of one, receipt=…")
    num_envs = min(num_envs, len(seeds))
    cls, scenario = scenario_of(task, num_envs, **making)
    cast, imported = cast_of(policy, cls)
    scenario.check(cls.reward_modes)
    together = grouped(seeds, num_envs)
    if receipt is None:
        job = EvaluationJob(cls, scenario, cast, together)
        scores = scores_of(executor, job, on_event)
        return Evaluation(cls.task_id, _name(cast), {seed: scores[seed] for seed in seeds})
    observed = read_mode(scenario.obs_mode).textures is not None
    if keep_pictures and not observed:
        raise TaskError(f"obs_mode {scenario.obs_mode!r} observes no pictures that could be kept")
    pictures = WatchedPictures(picture_interval, keep_pictures) if observed else None
    job = EvaluationJob(cls, scenario, cast, together, traced=True, pictures=pictures)
    described, folder = _described(job, imported, receipt), pictures_folder(receipt)

    def write_pictures(event: Event) -> None:
        if event.seed is not None and isinstance(event.result, TracedScore) and event.result.images:
            keep(event.result.images, event.seed, folder)
        on_event(event)

    found = scores_of(executor, job, write_pictures)
    written = receipt_of(described, job, {seed: found[seed] for seed in seeds})
    written.write(receipt)
    scores = {
        e.seed: Score(e.success, e.total, e.steps, e.reason, found[e.seed].waits, e.stage_score)
        for e in written.episodes
    }
    return Evaluation(cls.task_id, _name(cast), scores, written)


def _described(job: EvaluationJob, name: str | None, path: str | PathLike[str]) -> dict[str, Any]:
    """Return what is played for a receipt, and see, before anything is, that it can be written."""
    with writing_errors(path):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        if Path(path).is_dir():
            raise IsADirectoryError(EISDIR, "it is a folder; a receipt is a file")
    return describe_job(job, name)


def _name(cast: Cast) -> str:
    """Return who plays, in words."""
    if cast.expert is not None:
        return EXPERT
    if isinstance(cast.policy, (ServedPolicy, SharedPolicy)):
        return cast.policy.name
    return getattr(cast.policy, "__qualname__", type(cast.policy).__qualname__)


def _spread(by_seed: Mapping[int, float]) -> tuple[float, float, float]:
    """Return mean, smallest and largest."""
    values = by_seed.values()
    return mean(values), min(values), max(values)
