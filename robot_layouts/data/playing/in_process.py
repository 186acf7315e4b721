"""Plays whole episodes in this very process, and puts aside what they set for all of it."""

from __future__ import annotations

import random
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from threading import RLock
from typing import Any

import numpy as np
import torch

from robot_layouts.core.operating_system import after_fork
from robot_layouts.core.processes.transport import as_ours
from robot_layouts.data.playing.scheduler import Event, Play

_turn = RLock()


def seed_all(seed: int) -> None:
    """Begin the random generators of Python, NumPy and torch with a seed."""
    random.seed(seed)
    np.random.seed(seed)
    torch.manual_seed(seed)


def random_states() -> tuple[Any, ...]:
    """Return where these random generators are."""
    return random.getstate(), np.random.get_state(), torch.get_rng_state()


def set_random_states(states: tuple[Any, ...]) -> None:
    """Let these random generators go on from where they were."""
    python, numpy, of_torch = states
    random.setstate(python)
    np.random.set_state(numpy)
    torch.set_rng_state(of_torch)


class InProcessExecutor:
    """This very process, one episode after the other; what plays need not be picklable.

    Nothing limits how long an episode takes, and threads take turns, an episode each. The number of
    torch's threads and the state of the random generators are those of before whenever nothing is
    being played. If what plays has a method ``close``, that is called in the end.
    """

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `robot_layouts.data.playing.executor.Executor`."""
        kept: list[tuple[Any, ...]] = []
        with _playing(kept):
            play = prepare()
        try:
            for seed in seeds:
                with _playing(kept):
                    event = _played(play, seed)
                yield event
        finally:
            close = getattr(play, "close", None)
            if close is not None:
                close()


def _played(play: Play, seed: int) -> Event:
    try:
        return Event(seed, result=play(seed), worker="this process")
    except Exception as error:
        return Event(seed, error=as_ours(error), worker="this process")


@contextmanager
def _playing(kept: list[tuple[Any, ...]]) -> Generator[None]:
    """Put aside what a play sets for the whole process while it is not playing.

    One thread plays at a time: others would change the settings under it, and restore its own.

    Args:
        kept: What the play had set when it was interrupted, if it has begun.
    """
    with _turn:
        outside = _settings()
        if kept:
            _set(*kept.pop())
        try:
            yield
        finally:
            kept.append(_settings())
            _set(*outside)


def _begin_fork() -> None:
    """Let a fork play, in which a thread that was playing does not go on."""
    global _turn
    _turn = RLock()


after_fork(_begin_fork)


def _settings() -> tuple[Any, ...]:
    return torch.get_num_threads(), random_states()


def _set(threads: int, states: tuple[Any, ...]) -> None:
    torch.set_num_threads(threads)
    set_random_states(states)
