"""The server that workers are forks of: one process that has loaded the libraries.

A process that is spawned loads torch and SAPIEN for itself, which takes seconds. Here one server
does so for all. It has one thread and builds nothing, so its forks are as good as spawned ones.
"""

from __future__ import annotations

import atexit
import ctypes
import errno
import gc
import multiprocessing
import os
import pickle
import select
import signal
import socket
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import forkserver, resource_tracker, spawn
from typing import Any

from robots import RobotLayoutsError

LOADED = ("tasks.fronts.batch", "simulation")  # before any fork
UNGUARDED, MAIN_FAILED, NOT_LOADED = 81, 82, 83  # exit codes of workers that never began
PR_SET_PDEATHSIG = 1  # of Linux's prctl

_MOST_DESCRIPTORS = 253  # Linux's SCM_MAX_FD


class WorkerError(RobotLayoutsError, RuntimeError):
    """Worker processes that cannot be started, die, hang or fail; the base of all such errors."""


class ProcessError(WorkerError):
    """Worker processes that cannot be started."""


class UnguardedMainError(ProcessError):
    """A script that starts workers whenever it is imported, as each of them does."""


def end_with(parent: int) -> None:
    """Let this process be killed with its parent, whatever either is doing."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it was killed before
        os._exit(1)


@dataclass(frozen=True)
class Surroundings:
    """What a worker takes over that a spawned process would have inherited."""

    environment: dict[str, str]
    cores: set[int]
    streams: tuple[int, ...]

    @classmethod
    def of_this_process(cls) -> Surroundings:
        """Look around."""
        streams = tuple(number for number in (1, 2) if _is_open(number))
        return cls(dict(os.environ), os.sched_getaffinity(0), streams)

    def take_over(self, descriptors: Sequence[int]) -> None:
        """Take them over; ``descriptors`` are those of the streams."""
        os.environ.clear()
        os.environ.update(self.environment)
        if self.cores != os.sched_getaffinity(0):
            os.sched_setaffinity(0, self.cores)
        for number, descriptor in zip(self.streams, descriptors, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)


def serve(descriptor: int) -> None:
    """Load the libraries, then fork a worker for every request until the other side is gone."""
    for module in LOADED:
        import_module(module)
    gc.collect()
    gc.freeze()  # what is shared stays shared: no worker's collector writes to it
    _Forks(socket.socket(fileno=descriptor)).run()


class _Forks:
    """The workers that were forked, and what their exit codes are written to."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        self._status: dict[int, int] = {}
        self._ended, self._wake = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.signal(signal.SIGCHLD, lambda *_: None)  # else it would not wake us
        signal.set_wakeup_fd(self._wake)

    def run(self) -> None:
        poller = select.poll()
        poller.register(self._requests, select.POLLIN)
        poller.register(self._ended, select.POLLIN)
        while True:
            ready = {descriptor for descriptor, _ in poller.poll()}
            if self._ended in ready:
                os.read(self._ended, 65536)
                self._report_ended()
            if self._requests.fileno() in ready and not self._serve_one():
                return

    def _serve_one(self) -> bool:
        message, descriptors, flags, _ = socket.recv_fds(self._requests, 16, _MOST_DESCRIPTORS)
        if not message:
            return False
        cut = bool(flags & socket.MSG_CTRUNC)
        pid = -errno.EMFILE if cut else self._fork(descriptors)
        status, *rest = descriptors or [-1]
        if status >= 0:
            _answer(status, pid)
        if pid > 0:
            self._status[pid] = status
        elif status >= 0:
            os.close(status)
        for descriptor in rest:
            os.close(descriptor)
        return True

    def _fork(self, descriptors: Sequence[int]) -> int:
        status, *own = descriptors
        server = os.getpid()
        try:
            pid = os.fork()
        except OSError as error:
            return -(error.errno or errno.EAGAIN)
        if pid == 0:
            code = 1
            try:
                end_with(server)
                self._leave(status)
                code = _work(own)
            except BaseException:
                traceback.print_exc()
            finally:
                atexit._run_exitfuncs()  # pyright: ignore[reportPrivateUsage]
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)
        return pid

    def _leave(self, status: int) -> None:
        """Keep nothing of the server's in a worker."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._requests.close()
        for descriptor in (status, self._ended, self._wake, *self._status.values()):
            os.close(descriptor)

    def _report_ended(self) -> None:
        while self._status:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                return
            descriptor = self._status.pop(pid)
            _answer(descriptor, os.waitstatus_to_exitcode(status))
            os.close(descriptor)


def _answer(descriptor: int, number: int) -> None:
    with suppress(BrokenPipeError):  # nobody waits for it any more
        forkserver.write_signed(descriptor, number)


# -- a worker -----------------------------------------------------------------------------------


def _work(descriptors: Sequence[int]) -> int:
    """Be a worker: read what to run and run it; returns the exit code."""
    receive, tracker, *rest = descriptors
    resource_tracker._resource_tracker._fd = tracker  # type: ignore[attr-defined]
    sentinel = os.dup(receive)
    this: Any = multiprocessing.current_process()
    with open(receive, "rb") as pipe:
        surroundings: Surroundings = pickle.load(pipe)
        count = len(surroundings.streams)
        surroundings.take_over(rest[:count])
        forkserver._forkserver._inherited_fds = rest[count:]  # type: ignore[attr-defined]
        _draw_differently()
        spawn.prepare(pickle.load(pipe))
        main: Mapping[str, str] = pickle.load(pipe)
        this._inheriting = True
        try:
            spawn.prepare(main)
        except UnguardedMainError:
            return UNGUARDED
        except BaseException:
            traceback.print_exc()
            return MAIN_FAILED
        try:
            process = pickle.load(pipe)
        except Exception:
            traceback.print_exc()
            return NOT_LOADED
        del this._inheriting
    return process._bootstrap(sentinel)


def _draw_differently() -> None:
    """Seed NumPy's global stream anew: forks would all draw the same numbers."""
    sys.modules["numpy"].random.seed()


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
