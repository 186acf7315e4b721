"""Lets workers play the episodes of some seeds, again if one dies or takes too long."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.core.processes.worker import Reply, Status
from robots import TaskError

DEATHS_ALLOWED = 3  # of workers at one seed
EPISODE_SECONDS = 600.0  # some hundred times what our slowest expert takes
START_SECONDS = 600.0  # to load torch and SAPIEN from a busy disk, fetch robot files, build worlds
QUIET_SECONDS = 30.0  # without a reply until a note lists who plays what; twice as long each time

_WAIT_SECONDS = 1.0  # for replies, before deadlines are compared with the clock
_SHOWN = 4  # workers that a text names

Play = Callable[[int], Any]
"""Plays the episode of a seed and returns what is to be known of it (it can be pickled)."""


class WorkersDied(WorkerError):
    """Workers that died at one episode, as often as is allowed."""


@dataclass(frozen=True)
class Event:
    """What happened to the episode of a seed.

    Attributes:
        seed: Its seed; None if it is about a worker that was not playing yet, or about none.
        result: What was returned when it was played to the end, else None.
        error: Why it could not be played, else None; `WorkersDied` if workers died of it.
        died: How its worker died, in words, else None; the episode will be played again.
        note: What came meanwhile: from `report` if there is a seed, else from the executor, in
            words.
        worker: Who played it, in words.
    """

    seed: int | None
    result: Any = None
    error: Exception | None = None
    died: str | None = None
    note: Any = None
    worker: str = ""

    @property
    def death(self) -> str:
        """How its worker died, and what that was doing, in words."""
        if self.seed is None:
            return f"{self.died} before it could play anything"
        return f"{self.died} at seed {self.seed}"

    @property
    def news(self) -> str | None:
        """What a user should know of workers, in words; None if nothing."""
        if self.died is not None:
            return f"{self.death}; another takes its place"
        return None if self.seed is not None else self.note


class SeedWorker(Protocol):
    """A process somewhere that plays one seed at a time.

    Attributes:
        name: What it is called in messages.
        begun: When it began to run, by the monotonic clock (s); None while it waits for a place.
    """

    name: str
    begun: float | None

    def request(self, seed: int, /) -> Any:
        """Let it play a seed."""
        ...


AnyWorker = TypeVar("AnyWorker", bound=SeedWorker)


class WorkerBackend(Protocol[AnyWorker]):
    """Where workers come from: processes of this machine, or of others.

    A worker's first reply says that it is ready, or why it is not. Each seed then gets one reply,
    after any notes.
    """

    def spawn(self) -> AnyWorker:
        """Start a worker.

        Raises:
            WorkerError: If that is impossible.
        """
        ...

    def wait(self, seconds: float) -> Sequence[tuple[AnyWorker, Reply]]:
        """Wait for replies for a while (s).

        Raises:
            WorkerError: If no worker can reply any more.
        """
        ...

    def remove(self, worker: AnyWorker, *, kill: bool) -> None:
        """End a worker, at once or after a while in which it may do so by itself."""
        ...

    def status(self) -> str:
        """Return what else explains that no reply comes for long, in words.

        Raises:
            WorkerError: If none will come.
        """
        ...


@dataclass(frozen=True)
class RetryPolicy:
    """How often an episode may fail with its worker, and how long it may take.

    Attributes:
        attempts: How many workers may die of one episode before it is given up.
        fresh: Whether every episode gets a worker of its own.
        episode_timeout: Seconds that an episode may take, or from one `report` to the next, until
            its worker is ended, which counts as a death; None if it may take for ever.

    Raises:
        TaskError: If a number is not valid.
    """

    attempts: int = DEATHS_ALLOWED
    fresh: bool = False
    episode_timeout: float | None = EPISODE_SECONDS

    def __post_init__(self) -> None:
        """Check the numbers."""
        checked_whole("attempts", self.attempts, 1, None, TaskError)
        check_timeout(self.episode_timeout)


def check_timeout(value: float | None) -> None:
    """Refuse what is no limit in seconds.

    Raises:
        TaskError: If it is not one.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value is not None and not (number and 0 < value < math.inf):
        raise TaskError(
            f"episode_timeout is {value!r}; it must be seconds, more than 0, or None for no limit"
        )


@dataclass
class _Job:
    """What a worker does: begins, or plays a seed.

    Attributes:
        seed: What it plays; None if it begins.
        since: When it began, or sent its last note, by the clock (s).
    """

    seed: int | None
    since: float


class Scheduler(Generic[AnyWorker]):
    """The episodes of some seeds, played by workers of a backend; none is left in the end."""

    def __init__(
        self,
        backend: WorkerBackend[AnyWorker],
        seeds: Iterable[int],
        workers: int,
        policy: RetryPolicy,
    ) -> None:
        """Prepare to play.

        Args:
            backend: Where the workers come from.
            seeds: Which episodes.
            workers: How many play at a time.
            policy: When a worker or an episode is given up.
        """
        self._backend, self._waiting, self._workers = backend, deque(seeds), workers
        self._policy = policy
        self._jobs: dict[AnyWorker, _Job] = {}
        self._deaths = Counter[int | None]()

    def events(self) -> Generator[Event]:
        """Play; see `robot_layouts.data.playing.executor.Executor.run`."""
        last_reply, patience = time.monotonic(), QUIET_SECONDS
        try:
            while self._waiting or self._playing:
                while len(self._jobs) < min(self._workers, len(self._waiting) + self._playing):
                    self._jobs[self._backend.spawn()] = _Job(None, time.monotonic())
                replies = self._backend.wait(_WAIT_SECONDS)
                for worker, reply in replies:
                    if worker in self._jobs:  # it may have been ended meanwhile
                        yield from self._handle(worker, reply)
                yield from self._end_late()
                quiet = time.monotonic() - last_reply
                if replies:
                    last_reply, patience = time.monotonic(), QUIET_SECONDS
                elif quiet >= patience:
                    patience *= 2
                    yield Event(None, note=f"no message for {quiet:.0f} s: {self._doings()}")
        finally:
            for worker in self._jobs:
                self._backend.remove(worker, kill=True)

    @property
    def _playing(self) -> int:
        return sum(job.seed is not None for job in self._jobs.values())

    def _handle(self, worker: AnyWorker, reply: Reply) -> Generator[Event]:
        """Take a reply.

        Raises:
            RobotLayoutsError: What a worker could not begin for.
        """
        job, value = self._jobs[worker], reply.value
        job.since = time.monotonic()
        if reply.status is Status.NOTE:
            yield Event(job.seed, note=value, worker=worker.name)
        elif reply.status in (Status.DIED, Status.LOST):
            yield from self._lose(worker, value, counts=reply.status is Status.DIED)
        elif job.seed is not None:
            if reply.status is Status.FAILED:
                yield Event(job.seed, error=value, worker=worker.name)
            else:
                yield Event(job.seed, result=value, worker=worker.name)
            self._assign(worker, again=not self._policy.fresh)
        elif reply.status is Status.FAILED:
            raise value
        else:
            self._deaths[None] = 0
            self._assign(worker)

    def _assign(self, worker: AnyWorker, *, again: bool = True) -> None:
        if again and self._waiting:
            seed = self._waiting.popleft()
            self._jobs[worker] = _Job(seed, time.monotonic())
            worker.request(seed)
        else:
            del self._jobs[worker]
            self._backend.remove(worker, kill=False)

    def _end_late(self) -> Generator[Event]:
        for worker, job in list(self._jobs.items()):
            if worker.begun is None:
                continue
            limit = START_SECONDS if job.seed is None else self._policy.episode_timeout
            since = max(worker.begun, job.since)
            if limit is not None and time.monotonic() - since > limit:
                what = "was not ready" if job.seed is None else "did not finish the episode"
                yield from self._lose(worker, f"{what} within {limit:g} s and was ended")

    def _lose(self, worker: AnyWorker, how: str, *, counts: bool = True) -> Generator[Event]:
        """Let the episode of a worker be played again, unless too many died of it.

        Raises:
            WorkerError: If as many died as play at a time, and none became ready in between.
        """
        seed, died = self._jobs.pop(worker).seed, f"worker {worker.name} {how}"
        self._backend.remove(worker, kill=True)
        yield Event(seed, died=died, worker=worker.name)
        self._deaths[seed] += counts
        count = self._deaths[seed]
        if seed is None:
            if count >= max(DEATHS_ALLOWED, self._workers):
                raise WorkerError(
                    f"{count} worker processes died before they could play anything; the last:"
                    f" {died}"
                )
        elif count >= self._policy.attempts:
            ended = f"{count} worker process{'es' if count > 1 else ''}"
            what = f"the episode of seed {seed} ended {ended}; the last: {died}"
            yield Event(seed, error=WorkersDied(what))
        else:
            self._waiting.appendleft(seed)

    def _doings(self) -> str:
        status = self._backend.status()
        parts = [
            f"{worker.name} has been"
            f" {'getting ready' if job.seed is None else f'playing seed {job.seed}'}"
            f" for {time.monotonic() - job.since:.0f} s"
            for worker, job in self._jobs.items()
        ]
        more = [f"{len(parts) - _SHOWN} more"] if len(parts) > _SHOWN else []
        return "; ".join([*parts[:_SHOWN], *more, *filter(None, [status])])
