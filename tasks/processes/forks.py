"""Worker processes that start within milliseconds, as forks of `tasks.processes.fork_server`.

A worker takes the environment, the folder, the import path, the main module and the standard
streams over from the process that starts it, as they are at that moment.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import select
import signal
import socket
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext, suppress
from multiprocessing import forkserver, popen_forkserver, reduction, resource_tracker, spawn
from multiprocessing import util as _util
from multiprocessing.connection import wait
from multiprocessing.context import set_spawning_popen
from multiprocessing.process import BaseProcess
from threading import RLock
from typing import Any

from tasks.processes.fork_server import (
    MAIN_FAILED,
    NOT_LOADED,
    PR_SET_PDEATHSIG,
    UNGUARDED,
    ProcessError,
    Surroundings,
    UnguardedMainError,
)

_ENDINGS = {
    UNGUARDED: "imported the script that starts it, which started workers again; put what the"
    " script runs under `if __name__ == '__main__':`",
    MAIN_FAILED: "could not import the main module, for the reason that it printed",
    NOT_LOADED: "could not load what it was to run, for the reason that it printed",
}

_LOAD_SECONDS = 300.0  # until a server has loaded its libraries
_FORK_SECONDS = 60.0  # until one that has loaded them forks
_COMMAND = """\
import ctypes, os, sys
ctypes.CDLL(None).prctl({death}, {kill})
os.getppid() == {parent} or os._exit(1)
os.environ["OMP_NUM_THREADS"] = "1"
sys.path[:] = {path!r}
from tasks.processes.fork_server import serve
serve({descriptor})
"""

util: Any = _util  # what it starts processes with has no types


class WorkerProcess(BaseProcess):
    """A process that the server forks; otherwise like one of `multiprocessing`."""

    _start_method = "spawn"

    @staticmethod
    def _Popen(process: BaseProcess) -> _Popen:  # noqa: N802  (multiprocessing's name)
        return _Popen(process)


def ending(code: int | None) -> str:
    """Say how a worker ended, given its exit code; None if it still runs."""
    if code is None:
        return "closed its connection"
    if code in _ENDINGS:
        return _ENDINGS[code]
    return f"died by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


_ForkServerPopen: Any = popen_forkserver.Popen


class _Popen(_ForkServerPopen):
    """How `WorkerProcess` starts, ends and is waited for.

    In a fork of the process that started it, it counts as ended: nothing there can harm it.
    """

    def __init__(self, process: BaseProcess) -> None:
        self._owner, self._killed = os.getpid(), False
        self._lock = RLock()  # starting a process looks at all others, in another thread
        super().__init__(process)

    def _launch(self, process: BaseProcess) -> None:
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise UnguardedMainError(
                "this script starts workers when it is imported, which every worker does; put what"
                " it runs under `if __name__ == '__main__':`"
            )
        surroundings = Surroundings.of_this_process()
        preparation = spawn.get_preparation_data(process.name)
        main = {key: preparation.pop(key) for key in [*preparation] if "init_main" in key}
        if not os.path.exists(main.get("init_main_from_path", os.curdir)):
            main = {}  # the program was read from standard input
        packed = io.BytesIO()
        set_spawning_popen(self)
        try:
            for part in (surroundings, preparation, main, process):
                reduction.dump(part, packed)
        finally:
            set_spawning_popen(None)
        tracker: Any = resource_tracker.getfd()
        descriptors = [tracker, *surroundings.streams, *self._fds]
        self._server, (self.pid, self.sentinel, line) = _fork(descriptors)
        # The line stays open: its end tells the worker that this process has ended.
        self.finalizer = util.Finalize(self, util.close_fds, (line, self.sentinel))
        # A worker that was killed meanwhile is seen where its answers are read.
        with suppress(BrokenPipeError):
            try:
                _write(line, packed.getbuffer())
            except TimeoutError:
                os.kill(self.pid, signal.SIGKILL)
                raise

    def poll(self, flag: int = os.WNOHANG) -> int | None:
        if os.getpid() != self._owner:
            return 0
        if flag != os.WNOHANG and self.returncode is None:
            self._wait_for_end()
        with self._lock:
            return super().poll()

    def close(self) -> None:
        with self._lock if os.getpid() == self._owner else nullcontext():
            super().close()

    def _wait_for_end(self) -> None:
        """Wait for the server's word, which never comes if it is stopped."""
        if self._killed and not wait([self.sentinel], _FORK_SECONDS):
            self._server.kill()
        wait([self.sentinel])

    def _send_signal(self, sig: int) -> None:
        if self.poll() is None:
            self._killed = self._killed or sig == signal.SIGKILL
            super()._send_signal(sig)


def _write(descriptor: int, data: memoryview) -> None:
    """Write to a pipe, and give up once its reader has taken nothing for long."""
    os.set_blocking(descriptor, False)
    poller = select.poll()
    poller.register(descriptor, select.POLLOUT)
    while data:
        if not poller.poll(_FORK_SECONDS * 1000):
            raise TimeoutError(f"one took nothing of what it is to run for {_FORK_SECONDS:g} s")
        with suppress(BlockingIOError):
            data = data[os.write(descriptor, data) :]


class _Lost(Exception):
    """A server that does not fork any more."""


class _Server:
    """A server, seen from the process that it forks workers for."""

    def __init__(self) -> None:
        self._loaded = False
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        executable = spawn.get_executable()
        with theirs:
            command = _COMMAND.format(
                death=PR_SET_PDEATHSIG,
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
        with ExitStack() as ours, ExitStack() as theirs:
            status, exit_code = _pipe(ours, theirs)
            listens, line = _pipe(theirs, ours)
            try:
                socket.send_fds(self._socket, [b"fork"], [exit_code, listens, *descriptors])
                theirs.close()
                pid = self._answer(status)
            except (EOFError, ConnectionError):
                raise _Lost("ended, for the reason that it printed") from None
            if pid < 0:
                raise OSError(-pid, os.strerror(-pid))
            ours.pop_all()
        return pid, status, line

    def _answer(self, status: int) -> int:
        patience = _FORK_SECONDS if self._loaded else _LOAD_SECONDS
        if not wait([status], patience):
            raise _Lost(f"did not answer within {patience:g} s")
        self._loaded = True
        return forkserver.read_signed(status)

    def kill(self) -> None:
        """Kill it, and with it all that it forked; the next `fork` finds it lost."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)

    def end(self) -> None:
        """End it."""
        self._socket.close()
        self.kill()
        with suppress(ChildProcessError):  # somebody else waited for it
            os.waitpid(self._pid, 0)


_server: _Server | None = None


def _fork(descriptors: Sequence[int]) -> tuple[_Server, tuple[int, int, int]]:
    """Let the server fork; a new one takes the place of one that was killed or stopped."""
    global _server
    if _server is not None:
        try:
            return _server, _server.fork(descriptors)
        except _Lost:
            _server.end()
            _server = None
    new = _Server()
    try:
        result = new.fork(descriptors)
    except BaseException as error:
        new.end()
        if isinstance(error, _Lost):
            raise ProcessError(f"the process that forks workers {error}") from None
        raise
    _server = new
    return new, result


def _forget_server() -> None:
    global _server
    _server = None  # it is the parent's


os.register_at_fork(after_in_child=_forget_server)


def _pipe(reader: ExitStack, writer: ExitStack) -> tuple[int, int]:
    """Return a pipe whose ends are closed with what they belong to."""
    read, write = os.pipe()
    reader.callback(os.close, read)
    writer.callback(os.close, write)
    return read, write
