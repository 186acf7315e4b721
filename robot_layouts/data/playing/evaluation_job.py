"""Plays the episodes of an evaluation in workers, and keeps how they went and what they were.

Digests identify the states of an episode, and the pictures that policies observed in it.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Any, NoReturn

import numpy as np
import torch
from numpy.typing import NDArray

from robot_layouts.data.playing.environment import environment
from robot_layouts.data.playing.executor import Executor, play_all
from robot_layouts.data.playing.replay import bytes_of
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.playing.together import (
    EpisodePlayer,
    EpisodesJob,
    EpisodesPlay,
    one_by_one,
    play_together,
    states_together,
)
from robots import DivergedError
from tasks.episode import Score, States

BYTES = 2  # of a digest that are kept of each moment

Image = NDArray[Any]  # (H, W, k); of points (P, k)
Images = dict[str, dict[int, Image]]
"""By the picture's name and the control step, 0 being the reset."""


@dataclass(frozen=True)
class WatchedPictures:
    """Which pictures of an evaluation get a digest, and which are returned.

    Attributes:
        interval: Those after the reset and each so many-th control step get one.
        kept: Whether all of these are returned.
        expected: Seed → picture's name → first bytes of the digests that it should have, (M, 2);
            the first picture that has another one is returned.
    """

    interval: int = 1
    kept: bool = False
    expected: Mapping[int, Mapping[str, NDArray[np.uint8]]] = field(
        default_factory=dict[int, Mapping[str, NDArray[np.uint8]]]
    )


@dataclass(frozen=True)
class PictureTrace:
    """What identifies the pictures of one camera and texture in an episode.

    Attributes:
        pictures: SHA-256, in hex, over the SHA-256 of each.
        trace: The first two bytes of each one's SHA-256, in base64.
    """

    pictures: str
    trace: str


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
    for moment in np.concatenate([bytes_of(rows) for rows in entries.values()], axis=1):
        digest.update(moment)
        kept.append(digest.digest()[:BYTES])
    return StateTrace(digest.hexdigest(), b64encode(b"".join(kept)).decode())


def pictures_of(observation: Any) -> dict[str, Any]:
    """Return the pictures in an observation, (N, H, W, k) each, or points, (N, P, k).

    They are named by camera and texture, such as ``base_camera/rgb``; where an observation has the
    columns of a dataset, by these.
    """
    return dict(_pictures(observation, ""))


def _pictures(tree: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(tree, Mapping):
        for key, part in tree.items():
            if key != "sensor_param":
                yield from _pictures(part, f"{name}/{key}" if name else key)
    elif tree.ndim > 2:  # states are rows of numbers
        yield name.removeprefix("sensor_data/"), tree


def picture_digest(image: Image) -> bytes:
    """Return the SHA-256 of a picture's type and shape, and of its bytes."""
    digest = sha256(f"{image.dtype.str} {image.shape}\n".encode())
    digest.update(image.tobytes())
    return digest.digest()


def trace_of_pictures(digests: Iterable[bytes]) -> PictureTrace:
    """Return what identifies pictures, of which these are the SHA-256."""
    every = list(digests)
    kept = b"".join(digest[:BYTES] for digest in every)
    return PictureTrace(sha256(b"".join(every)).hexdigest(), b64encode(kept).decode())


class PictureWatch:
    """Looks at the pictures of episodes that are played at once."""

    def __init__(self, watched: WatchedPictures, players: Sequence[EpisodePlayer]) -> None:
        """Look at nothing yet.

        Args:
            watched: At which to look.
            players: Who plays, one after the other in the environments.
        """
        self._players, self._interval = players, watched.interval
        self._episodes = [
            _EpisodePictures(watched.kept, watched.expected.get(player.seed, {}))
            for player in players
        ]

    def __call__(self, observation: Any) -> None:
        """Look at what is observed after the reset, and then after each step."""
        step = max(len(player.moments) for player in self._players)
        if step % self._interval:
            return
        for name, rows in pictures_of(observation).items():
            for i, player in enumerate(self._players):
                if len(player.moments) == step:  # it is not over
                    self._episodes[i].add(name, step, np.asarray(rows[i]))

    def traces(self, player: int) -> dict[str, PictureTrace]:
        """Return what identifies the pictures that a player saw, by their names."""
        found = self._episodes[player].digests
        return {name: trace_of_pictures(digests) for name, digests in found.items()}

    def images(self, player: int) -> Images:
        """Return those of its pictures that were to be returned."""
        return self._episodes[player].images


class _EpisodePictures:
    def __init__(self, kept: bool, expected: Mapping[str, NDArray[np.uint8]]) -> None:
        self.digests: dict[str, list[bytes]] = {}
        self.images: Images = {}
        self._kept, self._expected = kept, expected

    def add(self, name: str, step: int, image: Image) -> None:
        digest, known = picture_digest(image), self.digests.setdefault(name, [])
        known.append(digest)
        if self._kept or (name not in self.images and self._unlike(name, len(known) - 1, digest)):
            self.images.setdefault(name, {})[step] = image.copy()

    def _unlike(self, name: str, place: int, digest: bytes) -> bool:
        expected = self._expected.get(name, ())
        return place < len(expected) and expected[place].tobytes() != digest[:BYTES]


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
        """Play the episodes of a seed and of those that are played together with it.

        Where physics diverges in one of several, each is played alone.
        """
        seeds = self._job.together[seed]
        try:
            return self._play(seeds)
        except DivergedError:
            return {seed: self._play([seed])[seed] for seed in seeds}

    def _play(self, seeds: Sequence[int]) -> dict[int, Score]:
        players = [self._casting(seed) for seed in seeds]
        for player in players:
            player.most = min(player.most, self._job.most_steps.get(player.seed, player.most))
        with torch.no_grad():
            if self._job.traced:
                return self._traced(self._job.pictures, players)
            play_together(self._env, players)
        return {player.seed: player.score for player in players}

    def _traced(
        self, pictures: WatchedPictures | None, players: Sequence[EpisodePlayer]
    ) -> dict[int, Score]:
        watch, about = PictureWatch(pictures or WatchedPictures(), players), environment()
        if pictures is None:
            played = states_together(self._env, players)
        else:
            for player in players:
                player.rehearsed = None  # without a look at its pictures
            played = states_together(self._env, players, watch)
            about = {**about, "graphics": self._env.simulation.describe_graphics()}
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
                    score = single.result
                    keeps = isinstance(score, TracedScore) and score.images
                    scores[single.seed] = replace(score, images={}) if keeps else score
            if event.error is not None:
                seeds = [event.seed] if event.seed is None else job.together[event.seed]
                _raise(event.error, seeds)
    return scores


def _raise(error: Exception, seeds: Sequence[int | None]) -> NoReturn:
    """Raise an error that says at which seeds it happened."""
    which = (
        f"seed {seeds[0]}" if len(seeds) == 1 else f"one of the seeds {', '.join(map(str, seeds))}"
    )
    error.args = (f"{which}: {error}", *error.args[1:])
    raise error
