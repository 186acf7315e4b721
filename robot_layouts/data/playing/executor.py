"""Who plays whole episodes, and which: worker processes that may die, or this process."""

from __future__ import annotations

import operator
import random
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing, contextmanager
from statistics import median
from threading import RLock
from typing import Any, Protocol

import numpy as np
import torch

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.operating_system import HAS_WORKERS, after_fork, cores
from robot_layouts.core.pages import plural
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.core.processes.transport import as_ours, packed
from robot_layouts.core.processes.worker import Pool, Reply, Worker
from robot_layouts.data.playing.scheduler import (
    DEATHS_ALLOWED,
    EPISODE_SECONDS,
    START_SECONDS,
    Event,
    Play,
    RetryPolicy,
    Scheduler,
)
from robots import TaskError

_PATIENCE = 10.0  # s that a worker may take to end by itself
_END = 2**32  # of seeds, as in native
_SHOWN = 10  # seeds that a text names

_turn = RLock()  # of threads that play in this process


class Executor(Protocol):
    """Something that plays whole episodes somewhere: in processes, or on other machines.

    Episodes must depend on nothing but their seed and what ``prepare`` holds.
    """

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed, in any order.

        Args:
            prepare: Called once in every worker; makes what plays there. It can be pickled. If it
                has ``modules``, other machines may need these.
            seeds: Which episodes.

        Yields:
            One event with a result or an error for every seed, as they end, one for every worker
            that died, and notes meanwhile.

        Raises:
            WorkerError: If no worker is available.
            RobotLayoutsError: What ``prepare`` raised.
        """
        ...


class ProcessExecutor:
    """Processes of this machine; none is left when `run` ends, whatever ends it."""

    def __init__(
        self,
        workers: int | None = 1,
        *,
        attempts: int = DEATHS_ALLOWED,
        fresh: bool = False,
        episode_timeout: float | None = EPISODE_SECONDS,
    ) -> None:
        """Choose how many processes play.

        Args:
            workers: How many at a time; None: one for each core that this process may use.
            attempts: How many workers may die of one episode before it is given up.
            fresh: Whether every episode gets a process of its own.
            episode_timeout: Seconds that an episode may take, or from one `report` to the next,
                until its worker is ended, which counts as a death; None if it may take for ever.

        Raises:
            TaskError: If a number is not valid.
        """
        if workers is not None:
            checked_whole("workers", workers, 1, None, TaskError)
        self.workers = cores() if workers is None else workers
        self._policy = RetryPolicy(attempts, fresh, episode_timeout)

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `Executor`."""
        return Scheduler(_Processes(prepare), seeds, self.workers, self._policy).events()


class _Processes:
    """The backend of this machine, whose workers all play the same."""

    def __init__(self, prepare: Callable[[], Play]) -> None:
        """Take what makes the plays.

        Raises:
            WorkerError: If it cannot be sent to processes.
        """
        self._job, self._pool = packed(prepare), Pool()

    def spawn(self) -> Worker:
        """Start a process, which runs the script of the user again only if the job is from it."""
        return self._pool.spawn(self._job, START_SECONDS, with_main=b"__main__" in self._job)

    def wait(self, seconds: float) -> list[tuple[Worker, Reply]]:
        """Wait for replies for a while (s)."""
        return self._pool.wait(seconds)

    def remove(self, worker: Worker, *, kill: bool) -> None:
        """End a process."""
        self._pool.remove(worker, 0.0 if kill else _PATIENCE)

    def status(self) -> str:
        """Return nothing: the workers are all that there is."""
        return ""


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
        """Play the episode of every seed; see `Executor`."""
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


def choose_executor(
    workers: int | None = None,
    executor: Executor | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
) -> Executor:
    """Return who plays.

    Args:
        workers: How many processes; 0: none, but this one; None: one for each core,
            and none where worker processes cannot start, as on macOS and Windows.
        executor: Who plays instead, as it was made.
        episode_timeout: See `ProcessExecutor`.

    Raises:
        TaskError: If a number is not valid, or contradicts the executor.
    """
    if workers is not None:
        checked_whole("workers", workers, 0, None, TaskError)
    limited = episode_timeout != EPISODE_SECONDS
    if executor is not None:
        if workers is not None or limited:
            raise TaskError(
                "an executor knows its own workers and episode_timeout; pass them where you make it"
            )
        return executor
    if workers == 0 or (workers is None and not HAS_WORKERS):
        if limited and episode_timeout is not None:
            raise TaskError(
                f"episode_timeout is {episode_timeout!r}, but with workers=0 this process plays,"
                " and nothing could end it; take workers=1"
            )
        return InProcessExecutor()
    return ProcessExecutor(workers, episode_timeout=episode_timeout)


def play_all(
    executor: Executor, prepare: Callable[[], Play], seeds: Sequence[int]
) -> Generator[Event]:
    """Play the episode of every seed; see `Executor`.

    Raises:
        WorkerError: If the executor ends without a result or an error for each, besides what it
            raises itself.
    """
    left: set[int | None] = set(seeds)
    with closing(executor.run(prepare, seeds)) as events:
        for event in events:
            if event.result is not None or event.error is not None:
                left.discard(event.seed)
            yield event
    if left:
        raise WorkerError(
            f"{type(executor).__name__} ended before {len(left)} of {len(seeds)} episodes were"
            " played"
        )


def modules_of(*things: Any) -> tuple[str, ...]:
    """Return the modules that define classes, functions, or the classes of other things."""
    known = (thing if hasattr(thing, "__module__") else type(thing) for thing in things)
    return tuple(dict.fromkeys(str(thing.__module__) for thing in known))


def checked_seeds(seeds: Iterable[int]) -> list[int]:
    """Return seeds as plain integers.

    Raises:
        TaskError: If they are not seeds, or one is there twice.
    """
    try:
        checked = [operator.index(seed) for seed in seeds]
    except TypeError:
        raise TaskError(f"seeds is {seeds!r}; it takes a sequence of integers") from None
    outside = [seed for seed in checked if not 0 <= seed < _END]
    if outside:
        raise TaskError(f"seed {outside[0]} must lie from 0 to 2**32 - 1")
    twice = [seed for seed, count in Counter(checked).items() if count > 1]
    if twice:
        raise TaskError(f"seed {twice[0]} is there twice; each episode is played once")
    return checked


def seed_lines(what: str, reasons: Mapping[int, str]) -> list[str]:
    """Return lines that name seeds, and say why, one line for each seed of which that is known.

    Args:
        what: What is to be said of them, such as ``"no success"``.
        reasons: Seed → why, in words; empty if that is unknown.
    """
    if not reasons:
        return []
    more = f" and {len(reasons) - _SHOWN} more" if len(reasons) > _SHOWN else ""
    named = f"seed{'s' * (len(reasons) > 1)} {', '.join(map(str, [*reasons][:_SHOWN]))}{more}"
    known = [f"seed {seed}: {reason}" for seed, reason in reasons.items() if reason]
    return [f"{what}: {named}", *known[:_SHOWN]]


def wait_lines(waits: Sequence[float]) -> list[str]:
    """Return a line that says how long a policy's server took for its answers (s), if it gave any.

    Args:
        waits: How long each took (s).
    """
    if not waits:
        return []
    middle, longest = 1e3 * median(waits), 1e3 * max(waits)
    answers = plural(len(waits), "answer")
    return [f"policy server: {answers}, median {middle:.1f} ms, longest {longest:.1f} ms"]
