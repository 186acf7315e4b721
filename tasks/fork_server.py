"""Worker processes within milliseconds: forks of one process that has loaded the libraries.

A process that is spawned loads torch and SAPIEN for itself, which takes seconds. Here one server
does so for all. It has one thread and builds nothing, so its forks are as good as spawned ones. A
worker takes the environment, the folder, the import path, the main module and the standard streams
over from the process that starts it, as they are at that moment.
"""

from __future__ import annotations

import atexit
import ctypes
import errno
import gc
import io
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
from multiprocessing import forkserver, popen_forkserver, reduction, resource_tracker, spawn, util
from multiprocessing.connection import wait
from multiprocessing.context import set_spawning_popen
from multiprocessing.process import BaseProcess
from typing import Any

from robots import RobotLayoutsError

LOADED = ("tasks.fronts.batch", "simulation")  # before any fork
UNGUARDED, MAIN_FAILED, NOT_LOADED = 81, 82, 83  # exit codes of workers that never began

_ENDINGS = {
    UNGUARDED: "imported the script that starts it, which started workers again; put what the"
    " script runs under `if __name__ == '__main__':`",
    MAIN_FAILED: "could not import the main module, for the reason that it printed",
    NOT_LOADED: "could not load what it was to run, for the reason that it printed",
}

_PATIENCE = 300.0  # s until a server has loaded its libraries
_MOST_DESCRIPTORS = 253  # Linux's SCM_MAX_FD
_PR_SET_PDEATHSIG = 1  # of Linux's prctl
_COMMAND = """\
import ctypes, os, sys
ctypes.CDLL(None).prctl({death}, {kill})
os.getppid() == {parent} or os._exit(1)
os.environ["OMP_NUM_THREADS"] = "1"
sys.path[:] = {path!r}
from tasks.fork_server import serve
serve({descriptor})
"""


class ProcessError(RobotLayoutsError, RuntimeError):
    """Worker processes that cannot be started."""


class UnguardedMainError(ProcessError):
    """A script that starts workers whenever it is imported, as each of them does."""


def end_with(parent: int) -> None:
    """Let this process be killed with its parent, whatever either is doing."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it was killed before
        os._exit(1)


class WorkerProcess(BaseProcess):
    """A process that the server forks; otherwise like one of `multiprocessing`."""

    _start_method = "spawn"

    @staticmethod
    def _Popen(process: BaseProcess) -> _Popen:  # noqa: N802  (multiprocessing's name)
        return _Popen(process)


@dataclass(frozen=True)
class _Surroundings:
    """What a worker takes over that a spawned process would have inherited."""

    environment: dict[str, str]
    cores: set[int]
    streams: tuple[int, ...]

    @classmethod
    def of_this_process(cls) -> _Surroundings:
        streams = tuple(number for number in (1, 2) if _is_open(number))
        return cls(dict(os.environ), os.sched_getaffinity(0), streams)

    def take_over(self, descriptors: Sequence[int]) -> None:
        """Take them over; ``descriptors`` are those of the streams."""
        os.environ.clear()
        os.environ.update(self.environment)
        os.sched_setaffinity(0, self.cores)
        for number, descriptor in zip(self.streams, descriptors, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)


class _Popen(popen_forkserver.Popen):
    """How `WorkerProcess` starts, ends and is waited for.

    In a fork of the process that started it, it counts as ended: nothing there can harm it.
    """

    def __init__(self, process: BaseProcess) -> None:
        self._owner = os.getpid()
        super().__init__(process)

    def _launch(self, process: BaseProcess) -> None:
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise UnguardedMainError(
                "this script starts workers when it is imported, which every worker does; put what"
                " it runs under `if __name__ == '__main__':`"
            )
        surroundings = _Surroundings.of_this_process()
        preparation = spawn.get_preparation_data(process.name)
        main = {key: preparation.pop(key) for key in [*preparation] if "init_main" in key}
        told = io.BytesIO()
        set_spawning_popen(self)
        try:
            for part in (surroundings, preparation, main, process):
                reduction.dump(part, told)
        finally:
            set_spawning_popen(None)
        descriptors = [resource_tracker.getfd(), *surroundings.streams, *self._fds]
        self.pid, self.sentinel, line = _fork(descriptors)
        alive = os.dup(line)  # open as long as this process lives
        self.finalizer = util.Finalize(self, util.close_fds, (alive, self.sentinel))
        with open(line, "wb") as pipe:
            with suppress(BrokenPipeError):  # it was killed: seen where its answers are read
                pipe.write(told.getbuffer())
                pipe.flush()

    def poll(self, flag: int = os.WNOHANG) -> int | None:
        return super().poll(flag) if os.getpid() == self._owner else 0

    def _send_signal(self, sig: int) -> None:
        if self.poll() is None:
            super()._send_signal(sig)


# -- the process that starts workers ------------------------------------------------------------


class _Server:
    """A server, seen from the process that it forks workers for."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        executable = spawn.get_executable()
        with theirs:
            command = _COMMAND.format(
                death=_PR_SET_PDEATHSIG,
                kill=int(signal.SIGKILL),
                parent=os.getpid(),
                path=spawn.get_preparation_data("server")["sys_path"],
                descriptor=theirs.fileno(),
            )
            words = [executable, *util._args_from_interpreter_flags(), "-c", command]
            # Ctrl-C is blocked in all that it forks. The tracker's own start, which was before,
            # would have let it through.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                self._pid = util.spawnv_passfds(executable, words, [theirs.fileno()])
            except BaseException:
                self._socket.close()
                raise

    def fork(self, descriptors: Sequence[int]) -> tuple[int, int, int]:
        """Return a worker's number, where its exit code can be read, and where it listens."""
        status, theirs = os.pipe()
        try:
            receive, line = os.pipe()
        except OSError:
            os.close(status)
            os.close(theirs)
            raise
        try:
            try:
                socket.send_fds(self._socket, [b"fork"], [theirs, receive, *descriptors])
            finally:
                os.close(theirs)
                os.close(receive)
            if not wait([status], _PATIENCE):
                raise ProcessError(f"no worker process was started within {_PATIENCE:g} s")
            pid = forkserver.read_signed(status)
            if pid < 0:
                raise OSError(-pid, os.strerror(-pid))
        except BaseException:
            os.close(status)
            os.close(line)
            raise
        return pid, status, line

    def end(self) -> str:
        """End it and return how it ended, in words."""
        self._socket.close()
        os.kill(self._pid, signal.SIGKILL)
        _, status = os.waitpid(self._pid, 0)
        return ending(os.waitstatus_to_exitcode(status))


_server: _Server | None = None


def _fork(descriptors: Sequence[int]) -> tuple[int, int, int]:
    """Let the server fork; a new one takes the place of one that was killed."""
    global _server
    if _server is not None:
        try:
            return _server.fork(descriptors)
        except (EOFError, ConnectionError):
            _server.end()
    _server = _Server()
    try:
        return _server.fork(descriptors)
    except (EOFError, ConnectionError):
        how, _server = _server.end(), None
        raise ProcessError(f"the process that forks workers {how}; see what it printed") from None


def _forget_server() -> None:
    global _server
    _server = None  # it is the parent's


os.register_at_fork(after_in_child=_forget_server)


def ending(code: int | None) -> str:
    """Say how a worker ended, given its exit code; None if it still runs."""
    if code is None:
        return "closed its connection"
    if code in _ENDINGS:
        return _ENDINGS[code]
    return f"died by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


# -- the server ---------------------------------------------------------------------------------


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
                atexit._run_exitfuncs()
                util._flush_std_streams()
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
        surroundings: _Surroundings = pickle.load(pipe)
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
