"""Worker processes: how they start, how they end with this one, how their errors come home."""

from __future__ import annotations

import errno
import functools
import multiprocessing
import multiprocessing.context
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from threading import Thread
from typing import TypeAlias

from robots import RobotLayoutsError
from tasks.processes.fork_server import ProcessError, WorkerError, end_with
from tasks.processes.forks import WorkerProcess, ending

__all__ = [
    "ProcessError",
    "Sendable",
    "WorkerError",
    "WorkerTraceback",
    "context",
    "end_with_parent",
    "ending",
    "enough",
    "start",
]

_WHAT_RAN_OUT = {
    errno.EMFILE: "; each takes three file descriptors: raise `ulimit -n` or take fewer",
    errno.ENFILE: "; this machine has too many files open",
    errno.EAGAIN: "; this user may have no more processes: raise `ulimit -u` or take fewer",
    errno.ENOMEM: "; there is too little memory: take fewer",
    errno.EFBIG: "; what they share must fit a file: raise `ulimit -f` or take fewer environments",
    errno.ENOSPC: "; there is too little memory to share: take fewer environments",
}

_Requests: TypeAlias = "SimpleQueue[tuple[BaseProcess, Future[None]]]"


class WorkerTraceback(Exception):
    """Where an error came up in another process: the ``__cause__`` of what is raised here."""

    def __str__(self) -> str:
        """Return the traceback as that process would have printed it."""
        return f"\n\n{self.args[0]}" if self.args else ""


class _Context(multiprocessing.context.SpawnContext):
    """Pipes, queues and processes of `multiprocessing`; the processes are forked by a server."""

    Process = WorkerProcess  # type: ignore[assignment]


context = _Context()


def start(process: BaseProcess) -> None:
    """Start a process of `context` that ends with this one, however this one ends.

    It never sees Ctrl-C: a terminal sends it to all, one is to act on it. A daemonic process may
    start some as well, as they do not outlive it.

    Raises:
        ProcessError: If descriptors, processes or memory run out, or the main module does not
            guard what it runs.
        Exception: What pickling the process's target and arguments raises.
    """
    started: Future[None] = Future()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with enough():
            _starter().put((process, started))
            started.result()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def enough() -> Generator[None]:
    """Say in one sentence what ran out while processes are started.

    Raises:
        ProcessError: In the place of an ``OSError`` or a ``MemoryError``.
    """
    try:
        yield
    except (OSError, MemoryError) as error:
        if isinstance(error, RobotLayoutsError):
            raise
        number = error.errno if isinstance(error, OSError) else errno.ENOMEM
        reason = _WHAT_RAN_OUT.get(number or 0, "")
        raise ProcessError(f"worker processes cannot be started: {error}{reason}") from error


def end_with_parent() -> None:
    """Let this process be killed with the one that started it, whatever either is doing.

    A process of `context` is so from its start.
    """
    parent = multiprocessing.parent_process()
    if parent is not None and not isinstance(multiprocessing.current_process(), WorkerProcess):
        end_with(parent.pid or 0)


class Sendable:
    """An error that arrives in another process together with where it came up.

    It is pickled as the error itself if that is one of ours, else as what ``otherwise`` makes of
    one line; the ``__cause__`` of what arrives is a `WorkerTraceback`.
    """

    def __init__(self, error: BaseException, otherwise: Callable[[str], RobotLayoutsError]) -> None:
        """Keep the error and its traceback, as text."""
        lines = traceback.format_exception(type(error), error, error.__traceback__)
        self._traceback = "".join(lines).rstrip()
        if isinstance(error, RobotLayoutsError) and _survives_pickling(error):
            self._error = error
        else:
            what = "".join(traceback.format_exception_only(error)).strip()
            frames = traceback.extract_tb(error.__traceback__)[-1:]
            where = "".join(f" ({frame.filename}:{frame.lineno})" for frame in frames)
            self._error = otherwise(what + where)

    def __reduce__(self) -> tuple[Callable[[Exception, str], Exception], tuple[Exception, str]]:
        """Pickle as the error."""
        return _arrived, (self._error, self._traceback)


def _arrived(error: Exception, text: str) -> Exception:
    error.__cause__ = WorkerTraceback(text)
    return error


def _survives_pickling(error: Exception) -> bool:
    try:
        arrived = pickle.loads(pickle.dumps(error))
        return type(arrived) is type(error) and str(arrived) == str(error)
    except Exception:  # whatever a class of the user's own does
        return False


@functools.cache
def _starter() -> _Requests:
    """Return where to ask for processes.

    Linux ends a process with the *thread* that started it, so that thread has to live as long as
    this process.
    """
    requests: _Requests = SimpleQueue()
    Thread(target=_start_all, args=(requests,), name="process starter", daemon=True).start()
    return requests


os.register_at_fork(after_in_child=_starter.cache_clear)  # threads do not survive a fork


def _start_all(requests: _Requests) -> None:
    while True:
        process, started = requests.get()
        try:
            with _as_if_not_daemonic():
                process.start()
        except BaseException as error:
            started.set_exception(error)
        else:
            started.set_result(None)
        del process, started  # held by nobody while this waits


@contextmanager
def _as_if_not_daemonic() -> Generator[None]:
    """Let a daemonic process have children, which `multiprocessing` fears would outlive it."""
    this = multiprocessing.current_process()
    daemonic, this.daemon = this.daemon, False
    try:
        yield
    finally:
        this.daemon = daemonic
