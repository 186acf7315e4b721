"""Worker processes of this machine."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from robots import RobotLayoutsError
from rollouts.playing.dispatch import Sign, Worker
from rollouts.playing.events import Event, Play, WorkerError
from rollouts.playing.transport import described, loaded, packed, portable
from tasks.processes import process as processes
from tasks.processes.worker import Worker as WorkerProcess

_PATIENCE = 10.0  # s that a worker may take to end by itself


def report(note: Any) -> None:
    """Tell the executor how far the episode is, from within a play.

    It arrives as an `Event` if a process of the same machine plays, else nowhere.
    """
    _send_note(note)


class LocalProcesses:
    """Spawned processes, which all play the same."""

    def __init__(self, prepare: Callable[[], Play]) -> None:
        """Take what makes the plays.

        Raises:
            WorkerError: If it cannot be sent to processes.
        """
        self._job, self._senders = packed(prepare), SimpleQueue[Worker]()

    def hire(self) -> Worker:
        """Start a process.

        Raises:
            WorkerError: If that is impossible.
        """
        return _Process(self._job, self._senders)

    def wait(self, workers: Sequence[Worker], seconds: float) -> list[Worker]:
        """Return the workers whose messages arrive within a while, in their order."""
        senders: list[Worker] = []
        with suppress(Empty):
            senders.append(self._senders.get(timeout=seconds))
            while True:
                senders.append(self._senders.get_nowait())
        return senders

    def remark(self) -> str:
        """Return nothing: the workers are all that there is."""
        return ""


class _Process:
    """One process, which plays one seed at a time.

    A thread talks with it: half a message, from a process that is stopped, would hold up whoever
    reads it.
    """

    def __init__(self, job: bytes, senders: SimpleQueue[Worker]) -> None:
        self.seed: int | None = None
        self._begun = False
        self._messages: SimpleQueue[object] = SimpleQueue()
        try:
            self._process = WorkerProcess(processes.context.Pipe(), _work)
        except (OSError, AssertionError) as error:  # too many files; a daemon has no children
            raise WorkerError(
                f"a worker process cannot be started: {error}; workers=0 plays in this process"
            ) from error
        self.name = f"process {self._process.pid}"
        self._connection = self._process.line
        self._thread = Thread(target=self._converse, args=(job, senders), daemon=True)
        self._thread.start()

    def send(self, seed: int) -> None:
        """Let it play a seed."""
        self.seed = seed
        self._send(seed)

    def receive(self) -> Event | Sign:
        """Return its next message.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        match self._messages.get_nowait():
            case Sign() as sign:
                self._begun = True
                return sign
            case _Report(note):
                return Event(self.seed, note=note, worker=self.name)
            case _Answer(result, error):
                seed, self.seed = self.seed, None
                return Event(seed, result=result, error=error, worker=self.name)
            case RobotLayoutsError() as error:
                raise error
            case _:
                return self._died()

    def late(self, seconds: float) -> Event:
        """Return how it dies if it is ended because it took longer than so many seconds."""
        what = "was not ready" if self.seed is None else "did not finish the episode"
        return self._death(f"{what} within {seconds:g} s and was ended")

    def dismiss(self) -> None:
        """Let it end by itself, for a while."""
        self._send(None)
        self._process.wait(_PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        self._process.kill(_PATIENCE)
        self._thread.join(_PATIENCE)
        if not self._thread.is_alive():
            self._connection.close()

    def _send(self, seed: int | None) -> None:
        with suppress(OSError):  # it died, which is a message too
            self._connection.send(seed)

    def _converse(self, job: bytes, senders: SimpleQueue[Worker]) -> None:
        with suppress(OSError):
            self._connection.send_bytes(job)
        while (message := self._read()) is not _GONE:
            self._messages.put(message)
            senders.put(self)
        self._messages.put(_GONE)
        senders.put(self)

    def _read(self) -> object:
        try:
            return self._connection.recv()
        except (EOFError, OSError):
            return _GONE
        except Exception as error:  # of a class that cannot be loaded here
            return _Answer(None, WorkerError(f"what was played cannot be read: {described(error)}"))

    def _died(self) -> Event:
        """Return how it died.

        Raises:
            WorkerError: If every other one would die like that.
        """
        self._process.wait(_PATIENCE)
        self.kill()
        code = self._process.exit_code or 0
        how = processes.ending(code)
        if code > 0 and not self._begun:
            raise WorkerError(f"a worker process could not begin: it {how}")
        return self._death(how)

    def _death(self, how: str) -> Event:
        return Event(self.seed, died=f"worker {self.name} {how}", worker=self.name)


# -- in the process ------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Report:
    """What a play says of itself before it is over."""

    note: Any


@dataclass(frozen=True)
class _Answer:
    """What has come of an episode; its error may be on the way, as a `Sendable`."""

    result: Any
    error: Any


_GONE = object()  # the last message


def _work(connection: Connection) -> None:
    """Be a worker: get what plays, say that it is ready, then answer each seed."""
    global _send_note
    processes.end_with_parent()
    _send_note = lambda note: connection.send(_Report(note))  # noqa: E731
    with suppress(EOFError, OSError):  # the main process is gone
        connection.send(Sign.BEGUN)
        play = _prepared(connection)
        while play is not None and (seed := connection.recv()) is not None:
            connection.send_bytes(_answer(play, seed))


def _prepared(connection: Connection) -> Play | None:
    job = connection.recv_bytes()
    try:
        play = loaded(job)()
    except Exception as error:
        connection.send(portable(error))
        return None
    connection.send(Sign.READY)
    return play


def _answer(play: Play, seed: int) -> bytes:
    """Play an episode; returns its `_Answer`, pickled."""
    try:
        return pickle.dumps(_Answer(play(seed), None))
    except (SystemExit, KeyboardInterrupt) as stop:
        return pickle.dumps(_Answer(None, WorkerError(described(stop))))
    except Exception as error:
        return pickle.dumps(_Answer(None, portable(error)))


def _drop_note(note: Any) -> None:
    pass


_send_note: Callable[[Any], None] = _drop_note
