"""Lets workers play the episodes of some seeds, and does not wait for ever for any of them."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

from robots import TaskError
from rollouts.playing.events import Event, WorkerError, WorkersDied

DEATHS_ALLOWED = 3  # of workers at one seed
EPISODE_SECONDS = 600.0  # some hundred times what our slowest expert takes
START_SECONDS = 600.0  # to load torch and SAPIEN from a busy disk, fetch robot files, build worlds
QUIET_SECONDS = 30.0  # without a message until a note lists who plays what; twice as long each time

_LOOK_SECONDS = 1.0  # between looks at the clock
_LEAP_SECONDS = 2.0  # that count at most from one look to the next
_SHOWN = 4  # workers that a text names


class Sign(Enum):
    """How far a worker is before it plays.

    Attributes:
        BEGUN: It has a place to run, and builds its worlds.
        READY: It can be sent a seed.
    """

    BEGUN = auto()
    READY = auto()


class Worker(Protocol):
    """Somebody who plays one seed at a time.

    Attributes:
        seed: What it plays; None if nothing.
        name: Who it is, in words.
    """

    seed: int | None
    name: str

    def send(self, seed: int) -> None:
        """Let it play a seed."""
        ...

    def receive(self) -> Event | Sign:
        """Return its next message.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        ...

    def late(self, seconds: float) -> Event:
        """Return how it dies if it is ended because it took longer than so many seconds."""
        ...

    def dismiss(self) -> None:
        """Let it end by itself, for a while."""
        ...

    def kill(self) -> None:
        """End it at once, even if it is stopped; it sends no more messages."""
        ...


class Crew(Protocol):
    """Where workers come from."""

    def hire(self) -> Worker:
        """Start a worker.

        Raises:
            WorkerError: If that is impossible.
        """
        ...

    def wait(self, workers: Sequence[Worker], seconds: float) -> Sequence[Worker]:
        """Wait for messages; returns the workers that sent them, each once for each message.

        Raises:
            WorkerError: If no worker can send a message any more.
        """
        ...

    def remark(self) -> str:
        """Return what else is to be known if no message comes for long, in words.

        Raises:
            WorkerError: If none will come.
        """
        ...


@dataclass(frozen=True)
class Rules:
    """When a worker, or an episode, is given up.

    Attributes:
        attempts: How many workers may die of one episode before it is given up.
        fresh: Whether every episode gets a worker of its own.
        episode_timeout: Seconds that an episode may take, or from one `report` to the next, until
            its worker is ended, which counts as a death; None if it may take for ever.

    Raises:
        TaskError: If a number makes no sense.
    """

    attempts: int = DEATHS_ALLOWED
    fresh: bool = False
    episode_timeout: float | None = EPISODE_SECONDS

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count("attempts", self.attempts, 1)
        check_timeout(self.episode_timeout)


def check_count(name: str, value: object, least: int) -> None:
    """Refuse what is no whole number, or too small.

    Raises:
        TaskError: If it is.
    """
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise TaskError(f"{name} is {value!r}; it must be a whole number, {least} or more")


def check_timeout(value: float | None) -> None:
    """Refuse what is no limit in seconds.

    Raises:
        TaskError: If it is none.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value is not None and not (number and 0 < value < math.inf):
        raise TaskError(
            f"episode_timeout is {value!r}; it must be seconds, more than 0, or None for no limit"
        )


class Shift:
    """The episodes of some seeds, played by workers of a crew; none of them is left in the end."""

    def __init__(self, crew: Crew, seeds: Iterable[int], count: int, rules: Rules) -> None:
        """Prepare to play.

        Args:
            crew: Where the workers come from.
            seeds: Which episodes.
            count: How many workers play at a time.
            rules: When a worker or an episode is given up.
        """
        self._crew, self._waiting, self._count = crew, deque(seeds), count
        self._rules, self._clock = rules, _Clock()
        self._since: dict[Worker, float] = {}  # when it began what it does
        self._deaths = Counter[int | None]()
        self._last_message, self._patience = 0.0, QUIET_SECONDS

    def events(self) -> Generator[Event]:
        """Play; see `rollouts.playing.executor.Executor.run`."""
        try:
            while self._waiting or self._playing:
                self._hire()
                senders = self._crew.wait(tuple(self._since), _LOOK_SECONDS)
                self._clock.tick()
                for worker in senders:
                    if worker in self._since:  # it may have been ended meanwhile
                        yield from self._handle(worker)
                yield from self._end_late()
                yield from self._break_silence(silent=not senders)
        finally:
            for worker in self._since:
                worker.kill()

    @property
    def _playing(self) -> int:
        return sum(worker.seed is not None for worker in self._since)

    def _hire(self) -> None:
        """Have as many workers as can be of use."""
        while len(self._since) < min(self._count, len(self._waiting) + self._playing):
            self._since[self._crew.hire()] = self._clock.time

    def _handle(self, worker: Worker) -> Generator[Event]:
        message = worker.receive()
        self._since[worker] = self._clock.time
        if message is Sign.READY:
            self._deaths[None] = 0
            self._assign(worker)
        elif isinstance(message, Event):
            yield message
            if message.died is not None:
                yield from self._replay(worker, message)
            elif message.note is None:
                self._assign(worker, again=not self._rules.fresh)

    def _assign(self, worker: Worker, *, again: bool = True) -> None:
        if again and self._waiting:
            worker.send(self._waiting.popleft())
        else:
            del self._since[worker]
            worker.dismiss()

    def _end_late(self) -> Generator[Event]:
        for worker, since in list(self._since.items()):
            limit = START_SECONDS if worker.seed is None else self._rules.episode_timeout
            if limit is not None and self._clock.time - since > limit:
                death = worker.late(limit)
                worker.kill()
                yield death
                yield from self._replay(worker, death)

    def _replay(self, worker: Worker, death: Event) -> Generator[Event]:
        """Let an episode be played again, unless too many workers died of it.

        Raises:
            WorkerError: If as many died as play at a time, and none became ready in between.
        """
        del self._since[worker]
        seed, died = death.seed, self._deaths
        died[seed] += not death.machine_lost
        if seed is None and died[seed] >= max(DEATHS_ALLOWED, self._count):
            raise WorkerError(
                f"{died[seed]} worker processes died before they could play anything; the last:"
                f" {death.died}"
            )
        if seed is not None and died[seed] >= self._rules.attempts:
            count = f"{died[seed]} worker process{'es' if died[seed] > 1 else ''}"
            what = f"the episode of seed {seed} ended {count}; the last: {death.died}"
            yield Event(seed, error=WorkersDied(what))
        elif seed is not None:
            self._waiting.appendleft(seed)

    def _break_silence(self, *, silent: bool) -> Generator[Event]:
        """Say who plays what for how long if there was no message for long."""
        if not silent:
            self._last_message, self._patience = self._clock.time, QUIET_SECONDS
        elif (quiet := self._clock.time - self._last_message) >= self._patience:
            self._patience *= 2
            yield Event(None, note=f"no message for {quiet:.0f} s: {self._doings()}")

    def _doings(self) -> str:
        remark = self._crew.remark()
        parts = [self._doing(worker) for worker in self._since]
        more = [f"{len(parts) - _SHOWN} more"] if len(parts) > _SHOWN else []
        return "; ".join([*parts[:_SHOWN], *more, *filter(None, [remark])])

    def _doing(self, worker: Worker) -> str:
        seconds = self._clock.time - self._since[worker]
        what = "getting ready" if worker.seed is None else f"playing seed {worker.seed}"
        return f"{worker.name} has been {what} for {seconds:.0f} s"


class _Clock:
    """Seconds that this process has been awake: its own being stopped makes no worker late.

    Attributes:
        time: As of the last tick.
    """

    def __init__(self) -> None:
        self.time, self._last = 0.0, time.monotonic()

    def tick(self) -> None:
        """Go on."""
        now = time.monotonic()
        self.time += min(now - self._last, _LEAP_SECONDS)
        self._last = now
