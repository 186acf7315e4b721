"""Plays whole episodes in worker processes, and survives workers that die."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol

from robots import RobotLayoutsError

Play = Callable[[int], Any]
"""Plays the episode of a seed and returns what is to be known of it (it can be pickled)."""

DEATHS_ALLOWED = 3  # of workers at one seed

_PATIENCE = 10.0  # s that a worker may take to end by itself

_context = multiprocessing.get_context("spawn")  # SAPIEN does not survive a fork


class WorkerError(RobotLayoutsError, RuntimeError):
    """Worker processes that cannot be started, or die again and again."""


@dataclass(frozen=True)
class Event:
    """What happened to the episode of a seed.

    Attributes:
        seed: Its seed; None if a worker died that was not playing yet.
        result: What was returned when it was played to the end, else None.
        error: Why it could not be played, else None.
        died: How its worker died, in words, else None; the episode will be played again.
    """

    seed: int | None
    result: Any = None
    error: Exception | None = None
    died: str | None = None


class Executor(Protocol):
    """Something that plays whole episodes somewhere: in processes, or on other machines.

    Episodes must depend on nothing but their seed and what ``prepare`` holds.
    """

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed, in any order.

        Args:
            prepare: Called once in every worker; makes what plays there. It can be pickled.
            seeds: Which episodes.

        Yields:
            One event with a result or an error for every seed, as they end, and one for every
            worker that died.

        Raises:
            WorkerError: If no worker can be had.
            RobotLayoutsError: What ``prepare`` raised.
        """
        ...


class ProcessExecutor:
    """Spawned processes of this machine; none is left when `run` ends, whatever ends it."""

    def __init__(self, workers: int = 1) -> None:
        """Choose how many processes play."""
        self.workers = workers

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `Executor`."""
        waiting, deaths = deque(seeds), Counter[int | None]()
        crew: list[_Worker] = []
        try:
            for _ in range(min(self.workers, len(waiting))):
                crew.append(_Worker(prepare))
            while crew:
                for connection in wait([worker.connection for worker in crew]):
                    worker = next(w for w in crew if w.connection is connection)
                    event = worker.receive()
                    if event is not None:
                        yield event
                    if event is not None and event.died is not None:
                        crew.remove(worker)
                        if event.seed is not None:
                            waiting.appendleft(event.seed)
                        deaths[event.seed] += 1
                        _expect_alive(event, deaths[event.seed])
                        if waiting:
                            crew.append(_Worker(prepare))
                    elif waiting:
                        worker.send(waiting.popleft())
                    else:
                        worker.dismiss()
                        crew.remove(worker)
        finally:
            for worker in crew:
                worker.kill()


class _Worker:
    """One process, which plays one seed at a time."""

    def __init__(self, prepare: Callable[[], Play]) -> None:
        self.connection, theirs = _context.Pipe()
        self.seed: int | None = None
        self._process = _context.Process(target=_work, args=(theirs, prepare), daemon=True)
        with _no_interrupts():
            try:
                self._process.start()
            except (pickle.PicklingError, AttributeError, TypeError) as error:
                raise WorkerError(
                    f"what the workers need cannot be sent to them: {error}; a task or an expert"
                    " must be defined in a module that they can import"
                ) from error
        theirs.close()

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
        if self.seed is None:
            if said is not None:
                raise said
            return None
        seed, (result, error) = self.seed, said
        return Event(seed, result=result, error=error)

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
        return Event(self.seed, died=f"worker process {self._process.pid} died {how}")


def _expect_alive(event: Event, deaths: int) -> None:
    if deaths < DEATHS_ALLOWED:
        return
    if event.seed is None:
        what = f"{deaths} worker processes died before they could play anything"
    else:
        what = f"the episode of seed {event.seed} ended {deaths} worker processes"
    raise WorkerError(f"{what}; the last: {event.died}")


def _work(connection: Connection, prepare: Callable[[], Play]) -> None:
    """Be a worker: say None when ready, then answer each seed with a result and an error."""
    try:
        play = prepare()
    except Exception as error:
        connection.send(_portable(error))
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
            answer = None, _portable(error)
        try:
            connection.send(answer)
        except OSError:
            os._exit(1)  # the main process is gone


def _portable(error: Exception) -> Exception:
    """Return an error that can be sent: ours as they are, others as text."""
    if isinstance(error, RobotLayoutsError):
        return error
    last = traceback.extract_tb(error.__traceback__)[-1]
    return WorkerError(f"{type(error).__name__}: {error} ({last.filename}:{last.lineno})")


@contextmanager
def _no_interrupts() -> Generator[None]:
    """Hold back Ctrl-C here, and for good in processes that are started meanwhile.

    A terminal sends it to all of them; only the main process is to act on it.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
