"""Plays whole episodes in worker processes, and survives workers that die."""

from __future__ import annotations

import os
import pickle
import signal
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol

from robots import RobotLayoutsError
from tasks import processes

Play = Callable[[int], Any]
"""Plays the episode of a seed and returns what is to be known of it (it can be pickled)."""

DEATHS_ALLOWED = 3  # of workers at one seed

UNSENDABLE = (pickle.PicklingError, AttributeError, TypeError)  # what pickling raises

_PATIENCE = 10.0  # s that a worker may take to end by itself


class WorkerError(RobotLayoutsError, RuntimeError):
    """Worker processes that cannot be started, or die again and again."""


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
        excused: Whether it is out of reach, with its machine perhaps: not the episode's fault.
        said: What was told meanwhile: by `report` if there is a seed, else by the executor, in
            words.
        worker: Who played it, in words.
    """

    seed: int | None
    result: Any = None
    error: Exception | None = None
    died: str | None = None
    excused: bool = False
    said: Any = None
    worker: str = ""


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
            that died, and what is said meanwhile.

        Raises:
            WorkerError: If no worker can be had.
            RobotLayoutsError: What ``prepare`` raised.
        """
        ...


class ProcessExecutor:
    """Spawned processes of this machine; none is left when `run` ends, whatever ends it."""

    def __init__(
        self, workers: int = 1, *, attempts: int = DEATHS_ALLOWED, fresh: bool = False
    ) -> None:
        """Choose how many processes play.

        Args:
            workers: How many at a time.
            attempts: How many workers may die of one episode before it is given up.
            fresh: Whether every episode gets a process of its own.
        """
        self.workers, self._attempts, self._fresh = workers, attempts, fresh

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `Executor`."""
        shift = Shift(
            _Processes(prepare), seeds, self.workers, attempts=self._attempts, fresh=self._fresh
        )
        return shift.events()


def report(said: Any) -> None:
    """Tell the executor how far the episode is, from within a play.

    It arrives as an `Event` if a process of the same machine plays, else nowhere.
    """
    _tell(said)


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

    def receive(self) -> Event | None:
        """Return what it says; None if it has just become ready.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        ...

    def dismiss(self) -> None:
        """Let it end by itself, for a while."""
        ...

    def kill(self) -> None:
        """End it at once."""
        ...


class Crew(Protocol):
    """Where workers come from."""

    def hire(self) -> Worker:
        """Start a worker.

        Raises:
            WorkerError: If that is impossible.
        """
        ...

    def wait(self, workers: Sequence[Worker]) -> Sequence[Worker] | str:
        """Wait until some of the workers say something; returns them, or why that takes long."""
        ...


class Shift:
    """The episodes of some seeds, played by workers of a crew; none of them is left in the end."""

    def __init__(
        self,
        crew: Crew,
        seeds: Iterable[int],
        count: int,
        *,
        attempts: int = DEATHS_ALLOWED,
        fresh: bool = False,
    ) -> None:
        """Prepare to play.

        Args:
            crew: Where the workers come from.
            seeds: Which episodes.
            count: How many workers play at a time.
            attempts: How many workers may die of one episode before it is given up.
            fresh: Whether every episode gets a worker of its own.
        """
        self._crew, self._waiting, self._count = crew, deque(seeds), count
        self._attempts, self._fresh = attempts, fresh
        self._workers: list[Worker] = []
        self._deaths = Counter[int | None]()

    def events(self) -> Generator[Event]:
        """Play; see `Executor.run`."""
        try:
            while self._waiting or self._playing:
                self._hire()
                ready = self._crew.wait(self._workers)
                if isinstance(ready, str):
                    yield Event(None, said=ready)
                    continue
                for worker in ready:
                    yield from self._hear(worker)
        finally:
            for worker in self._workers:
                worker.kill()

    @property
    def _playing(self) -> int:
        return sum(worker.seed is not None for worker in self._workers)

    def _hire(self) -> None:
        """Have as many workers as can be of use."""
        while len(self._workers) < min(self._count, len(self._waiting) + self._playing):
            self._workers.append(self._crew.hire())

    def _hear(self, worker: Worker) -> Generator[Event]:
        event = worker.receive()
        if event is not None:
            yield event
        if event is not None and event.died is not None:
            self._workers.remove(worker)
            yield from self._bury(event)
        elif event is None or event.said is None:
            self._employ(worker, again=event is None or not self._fresh)

    def _employ(self, worker: Worker, *, again: bool) -> None:
        if again and self._waiting:
            worker.send(self._waiting.popleft())
        else:
            self._workers.remove(worker)
            worker.dismiss()

    def _bury(self, event: Event) -> Generator[Event]:
        """Let an episode be played again, unless too many workers died of it.

        Raises:
            WorkerError: If too many died before they could play anything.
        """
        seed, died = event.seed, self._deaths
        died[seed] += not event.excused
        if seed is None and died[seed] >= DEATHS_ALLOWED:
            raise WorkerError(
                f"{died[seed]} worker processes died before they could play anything; the last:"
                f" {event.died}"
            )
        if seed is not None and died[seed] >= self._attempts:
            count = f"{died[seed]} worker process{'es' if died[seed] > 1 else ''}"
            what = f"the episode of seed {seed} ended {count}; the last: {event.died}"
            yield Event(seed, error=WorkersDied(what))
        elif seed is not None:
            self._waiting.appendleft(seed)


def modules_of(*things: Any) -> tuple[str, ...]:
    """Return the modules that define classes, functions, or the classes of other things."""
    known = (thing if hasattr(thing, "__module__") else type(thing) for thing in things)
    return tuple(dict.fromkeys(str(thing.__module__) for thing in known))


def portable(error: Exception) -> processes.Sendable:
    """Return what arrives elsewhere as an error of ours, with its traceback as its cause."""
    return processes.Sendable(error, WorkerError)


def unsendable(error: Exception) -> WorkerError:
    """Return what to raise if pickling what the workers need raised ``error``."""
    return WorkerError(
        f"what the workers need cannot be sent to them: {error}; a task, an expert or a policy must"
        " be defined in a module that they can import"
    )


# -- processes of this machine -------------------------------------------------------------------


@dataclass(frozen=True)
class _Processes:
    """Spawned processes."""

    prepare: Callable[[], Play]

    def hire(self) -> _Process:
        """Start a process."""
        return _Process(self.prepare)

    def wait(self, workers: Sequence[Worker]) -> list[Worker]:
        """Return the workers that have something to say."""
        here = [worker for worker in workers if isinstance(worker, _Process)]
        ready = wait([worker.connection for worker in here])
        return [worker for worker in here if worker.connection in ready]


class _Process:
    """One process, which plays one seed at a time."""

    def __init__(self, prepare: Callable[[], Play]) -> None:
        self.connection, theirs = processes.context.Pipe()
        self.seed: int | None = None
        self._process = processes.context.Process(target=_work, args=(theirs, prepare), daemon=True)
        try:
            processes.start(self._process)
        except UNSENDABLE as error:
            raise unsendable(error) from error
        theirs.close()
        self.name = f"process {self._process.pid}"

    def send(self, seed: int) -> None:
        """Let it play a seed."""
        self.seed = seed
        with suppress(OSError):  # it died: that is read from the connection
            self.connection.send(seed)

    def receive(self) -> Event | None:
        """Return what it says; None if it has just become ready.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        try:
            said = self.connection.recv()
        except (EOFError, OSError):
            return self._died()
        if isinstance(said, _Report):
            return Event(self.seed, said=said.said, worker=self.name)
        if self.seed is None:
            if said is not None:
                raise said
            return None
        seed, self.seed = self.seed, None
        result, error = said
        return Event(seed, result=result, error=error, worker=self.name)

    def dismiss(self) -> None:
        """Let it end by itself, for a while."""
        self.connection.close()
        self._process.join(_PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        self.connection.close()
        self._process.kill()
        self._process.join()

    def _died(self) -> Event:
        self.connection.close()
        self._process.join()
        code = self._process.exitcode or 0
        how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        return Event(self.seed, died=f"worker {self.name} died {how}", worker=self.name)


@dataclass(frozen=True)
class _Report:
    """What a play says of itself before it is over."""

    said: Any


def _work(connection: Connection, prepare: Callable[[], Play]) -> None:
    """Be a worker: say None when ready, then answer each seed with a result and an error."""
    global _tell
    processes.end_with_parent()
    _tell = lambda said: connection.send(_Report(said))  # noqa: E731
    try:
        play = prepare()
    except Exception as error:
        connection.send(portable(error))
        return
    connection.send(None)
    while True:
        try:
            seed = connection.recv()
        except (EOFError, OSError):
            return  # dismissed, or the main process is gone
        try:
            answer = play(seed), None
        except Exception as error:
            answer = None, portable(error)
        try:
            connection.send(answer)
        except OSError:
            os._exit(1)  # the main process is gone


def _tell_nobody(said: Any) -> None:
    pass


_tell: Callable[[Any], None] = _tell_nobody
