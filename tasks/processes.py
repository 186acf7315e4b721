"""Worker processes: how they start, how they end with this one, how their errors come home."""

from __future__ import annotations

import ctypes
import functools
import multiprocessing
import os
import pickle
import signal
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from threading import Thread
from typing import TypeAlias

from robots import RobotLayoutsError

_PR_SET_PDEATHSIG = 1  # of Linux's prctl

context = multiprocessing.get_context("spawn")  # SAPIEN does not survive a fork

_Requests: TypeAlias = "SimpleQueue[tuple[BaseProcess, Future[None]]]"


class WorkerTraceback(Exception):
    """Where an error came up in another process: the ``__cause__`` of what is raised here."""

    def __str__(self) -> str:
        """Return the traceback as that process would have printed it."""
        return f"\n\n{self.args[0]}" if self.args else ""


def start(process: BaseProcess) -> None:
    """Start a process that never sees Ctrl-C: a terminal sends it to all, one is to act on it.

    Raises:
        Exception: What pickling the process's target and arguments raises.
    """
    started: Future[None] = Future()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        _starter().put((process, started))
        started.result()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """Let this process be killed with the one that started it, whatever either is doing."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent.pid:  # it was killed before
        os._exit(1)


class Sendable:
    """An error that arrives in another process together with where it came up.

    It is pickled as the error itself if that is one of ours, else as what ``otherwise`` makes of
    one line; the ``__cause__`` of what arrives is a `WorkerTraceback`.
    """

    def __init__(self, error: Exception, otherwise: Callable[[str], RobotLayoutsError]) -> None:
        """Keep the error and its traceback, as text."""
        lines = traceback.format_exception(type(error), error, error.__traceback__)
        self._traceback = "".join(lines).rstrip()
        self._error = error
        if not (isinstance(error, RobotLayoutsError) and _survives_pickling(error)):
            last = traceback.extract_tb(error.__traceback__)[-1]
            self._error = otherwise(
                f"{type(error).__name__}: {error} ({last.filename}:{last.lineno})"
            )

    def __reduce__(self) -> tuple[Callable[[Exception, str], Exception], tuple[Exception, str]]:
        """Pickle as the error."""
        return _arrived, (self._error, self._traceback)


def _arrived(error: Exception, text: str) -> Exception:
    error.__cause__ = WorkerTraceback(text)
    return error


def _survives_pickling(error: Exception) -> bool:
    try:
        return type(pickle.loads(pickle.dumps(error))) is type(error)
    except Exception:  # whatever a class of the user's own does
        return False


@functools.cache
def _starter() -> _Requests:
    """Return where to ask for processes.

    `end_with_parent` ends a process with the *thread* that started it, so that thread has to live
    as long as this process.
    """
    requests: _Requests = SimpleQueue()
    Thread(target=_start_all, args=(requests,), name="process starter", daemon=True).start()
    return requests


os.register_at_fork(after_in_child=_starter.cache_clear)  # threads do not survive a fork


def _start_all(requests: _Requests) -> None:
    resource_tracker.ensure_running()  # else the first start runs it, which lets Ctrl-C through
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by what is started
    while True:
        process, started = requests.get()
        try:
            process.start()
        except BaseException as error:
            started.set_exception(error)
        else:
            started.set_result(None)
