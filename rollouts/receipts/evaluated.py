"""Makes the receipt of an evaluation: what is played is described before, the rest after it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rollouts.playing.casting import Cast
from rollouts.playing.evaluation_job import EvaluationJob, TracedScore
from rollouts.playing.together import is_batched
from rollouts.reading.guessed_robots import describe_guessed
from rollouts.receipts.making import describe_making
from rollouts.receipts.receipt import EpisodeReceipt, Receipt
from rollouts.receipts.sources import (
    describe_expert,
    describe_policy,
    describe_task,
    variables_read,
)
from tasks.episode import Score


def describe_job(job: EvaluationJob, name: str | None = None) -> dict[str, Any]:
    """Return the parts of a receipt that say what is played: ``task``, ``policy``, ``making``.

    Args:
        job: What is played.
        name: Where its policy was imported from, ``module:name``; None: it is looked for.

    Raises:
        AssetError: If robot files cannot be found.
        ReceiptError: If a file of the policy cannot be read.
    """
    at_once = job.scenario.num_envs if is_batched(job.cast.policy) else None
    return {
        "task": describe_task(job.task),
        "policy": _describe(job.cast, name),
        "making": describe_making(job.task, job.scenario, at_once),
    }


def receipt_of(
    described: Mapping[str, Any], job: EvaluationJob, scores: Mapping[int, Score]
) -> Receipt:
    """Return the receipt of episodes that were played.

    Args:
        described: What `describe_job` said before.
        job: What was played.
        scores: Seed → how it went, each a `TracedScore`.
    """
    traced = {seed: score for seed, score in scores.items() if isinstance(score, TracedScore)}
    more = {
        "guessed": describe_guessed(job.scenario.layout),
        "variables": variables_read(job.cast.policy, described["policy"]["name"]),
    }
    return Receipt(
        **described,
        environment={
            **_environment(score.environment for score in traced.values()),
            **{name: value for name, value in more.items() if value},
        },
        episodes=tuple(_episode(seed, score) for seed, score in traced.items()),
    )


def _describe(cast: Cast, name: str | None) -> dict[str, Any]:
    if cast.expert is not None:
        return describe_expert(cast.expert)
    return describe_policy(cast.policy, name)


def _environment(found: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the environment of the first episode, and in ``others`` those that differ from it."""
    different: list[Mapping[str, Any]] = []
    for environment in found:
        if environment not in different:
            different.append(environment)
    first, *others = different
    return {**first, **({"others": others} if others else {})}


def _episode(seed: int, score: TracedScore) -> EpisodeReceipt:
    trace = score.trace
    return EpisodeReceipt(
        seed, score.success, score.steps, score.total, trace.states, trace.trace, score.reason
    )
