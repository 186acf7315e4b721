"""Plays the episodes of an evaluation in workers, and keeps how they went and what they were."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Any, NoReturn

import numpy as np
import torch
from numpy.typing import NDArray

from robot_layouts.data.playing.environment import environment
from robot_layouts.data.playing.executor import Executor, play_all
from robot_layouts.data.playing.picture_digests import (
    BYTES,
    Images,
    PictureTrace,
    PictureWatch,
    WatchedPictures,
)
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.playing.together import (
    EpisodePlayer,
    EpisodesJob,
    EpisodesPlay,
    one_by_one,
    play_together,
    states_together,
)
from tasks.episode import Score, States


@dataclass(frozen=True)
class StateTrace:
    """What identifies the states of an episode of T steps.

    Attributes:
        states: SHA-256, in hex, over all T + 1 states.
        trace: The first two bytes of that digest as it stood at each of these, in base64.
    """

    states: str
    trace: str


def trace_of(states: States) -> StateTrace:
    """Return the digest of an episode's states.

    It is over the names, types and sizes of the state dict's entries, sorted by name, and then
    over the bytes of these entries after the reset and after each step.

    Args:
        states: State dict of `TaskEnv.get_state_dict`, each entry (T + 1, k).
    """
    entries = {
        f"{kind}/{name}": rows
        for kind, by_name in sorted(states.items())
        for name, rows in sorted(by_name.items())
    }
    about = (f"{name} {rows.dtype.str} {rows.shape[1:]}\n" for name, rows in entries.items())
    digest = sha256("".join(about).encode())
    kept: list[bytes] = []
    for moment in np.concatenate([_bytes(rows) for rows in entries.values()], axis=1):
        digest.update(moment)
        kept.append(digest.digest()[:BYTES])
    return StateTrace(digest.hexdigest(), b64encode(b"".join(kept)).decode())


def _bytes(rows: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8)


@dataclass(frozen=True)
class TracedScore(Score):
    """How an episode went, with a digest of its states.

    Attributes:
        trace: The digest.
        environment: On what it was played; see `robot_layouts.data.playing.environment`.
        pictures: The digests of its pictures, by their names, if they were watched.
        images: Those of its pictures that were to be returned.
    """

    trace: StateTrace = field(kw_only=True)
    environment: Mapping[str, Any] = field(kw_only=True, compare=False)
    pictures: Mapping[str, PictureTrace] = field(
        kw_only=True, default_factory=dict[str, PictureTrace]
    )
    images: Images = field(kw_only=True, default_factory=Images, compare=False)


@dataclass(frozen=True)
class EvaluationJob(EpisodesJob):
    """Episodes whose scores count.

    Attributes:
        traced: Whether each score is to be a `TracedScore`.
        most_steps: Seed → steps after which its episode ends, if it has not ended before.
        pictures: Which pictures get digests, if it is traced; None: none do.
    """

    traced: bool = False
    most_steps: Mapping[int, int] = field(default_factory=dict[int, int])
    pictures: WatchedPictures | None = None

    def __call__(self) -> Callable[[int], dict[int, Score]]:
        """Make the task in a worker, and return what plays the episodes of a seed and others."""
        return _EvaluationPlay(self)


class _EvaluationPlay(EpisodesPlay[EvaluationJob]):
    def __call__(self, seed: int) -> dict[int, Score]:
        """Play the episodes of a seed and of those that are played together with it."""
        players = [self._casting(seed) for seed in self._job.together[seed]]
        for player in players:
            player.most = min(player.most, self._job.most_steps.get(player.seed, player.most))
        with torch.no_grad():
            if not self._job.traced:
                play_together(self._env, players)
                return {player.seed: player.score for player in players}
            if self._job.pictures is not None:
                return self._watched(self._job.pictures, players)
            played = states_together(self._env, players)
        return {
            player.seed: TracedScore(
                **vars(player.score), trace=trace_of(states), environment=environment()
            )
            for player, states in zip(players, played, strict=True)
        }

    def _watched(
        self, pictures: WatchedPictures, players: Sequence[EpisodePlayer]
    ) -> dict[int, Score]:
        for player in players:
            player.rehearsed = None  # without a look at its pictures
        watch = PictureWatch(pictures, players)
        played = states_together(self._env, players, watch)
        about = {**environment(), "graphics": self._env.simulation.describe_graphics()}
        return {
            player.seed: TracedScore(
                **vars(player.score),
                trace=trace_of(states),
                environment=about,
                pictures=watch.traces(i),
                images=watch.images(i),
            )
            for i, (player, states) in enumerate(zip(players, played, strict=True))
        }


def scores_of(
    executor: Executor, job: EvaluationJob, on_event: Callable[[Event], None]
) -> dict[int, Score]:
    """Play all episodes of a job, and return how each went, by seed.

    Args:
        executor: Who plays.
        job: What is played.
        on_event: Called with each event of the executor, one for each episode. Images are only
            in these.

    Raises:
        WorkerError: If an episode cannot be played.
    """
    scores: dict[int, Score] = {}
    with closing(play_all(executor, job, list(job.together))) as events:
        for event in events:
            for single in one_by_one(event):
                on_event(single)
                if single.seed is not None and isinstance(single.result, Score):
                    scores[single.seed] = _without_images(single.result)
            if event.error is not None:
                seeds = [event.seed] if event.seed is None else job.together[event.seed]
                _raise(event.error, seeds)
    return scores


def _without_images(score: Score) -> Score:
    return replace(score, images={}) if isinstance(score, TracedScore) else score


def _raise(error: Exception, seeds: Sequence[int | None]) -> NoReturn:
    """Raise an error that says at which seeds it happened."""
    which = (
        f"seed {seeds[0]}" if len(seeds) == 1 else f"one of the seeds {', '.join(map(str, seeds))}"
    )
    error.args = (f"{which}: {error}", *error.args[1:])
    raise error
