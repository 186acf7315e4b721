"""How worker processes start: as forks of a server that has loaded what they need.

A process that is spawned loads torch and SAPIEN for itself, which takes seconds. The server is that
of `multiprocessing`; this module adds that workers end with this process whatever ends it, and that
they have its environment variables and cores as they are when a worker starts.
"""

from __future__ import annotations

import ctypes
import errno
import functools
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Generator
from concurrent.futures import Future, wait
from contextlib import ExitStack, contextmanager, suppress
from importlib import reload
from multiprocessing import forkserver, resource_tracker
from multiprocessing.process import BaseProcess
from multiprocessing.spawn import get_preparation_data
from queue import SimpleQueue
from threading import RLock, Thread
from typing import Any, TypeAlias
from weakref import WeakSet

from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.operating_system import HAS_WORKERS, after_fork

SERVER_OF = "ROBOT_LAYOUTS_SERVER_OF"  # variable of the server: the process that it serves
PRELOAD = "ROBOT_LAYOUTS_PRELOAD"  # likewise: the modules that it loads

_PR_SET_PDEATHSIG = 1  # of Linux's prctl
_PAUSES = (0.02, 0.1, 0.5)  # s; after each a server is asked again that was about to end
_DESCRIPTORS = 12  # that starting a process takes for a moment, and the server as well
_WHAT_RAN_OUT = {
    errno.EMFILE: "; each takes three file descriptors: raise `ulimit -n` or take fewer",
    errno.ENFILE: "; this machine has too many files open",
    errno.EAGAIN: "; this user may have no more processes: raise `ulimit -u` or take fewer",
    errno.ENOMEM: "; there is too little memory: take fewer",
    errno.EFBIG: "; what they share must fit a file: raise `ulimit -f` or take fewer environments",
    errno.ENOSPC: "; there is too little memory to share: take fewer environments",
}

_Call: TypeAlias = "tuple[Callable[[], BaseProcess], Future[BaseProcess]]"
_preloaded: dict[str, None] = {}  # modules, in order
_started: WeakSet[BaseProcess] = WeakSet()
_server_is_inherited = False
_lock = RLock()  # two threads that read an exit code at the same time get a wrong one


class WorkerError(RobotLayoutsError, RuntimeError):
    """Worker processes that cannot be started, die, hang or fail; the base of all such errors."""


class ProcessError(WorkerError):
    """Worker processes that cannot be started."""


def preload(*modules: str) -> None:
    """Let the server load modules before it forks a worker; for those that workers will import."""
    _preloaded.update(dict.fromkeys(modules))


def expect_workers() -> None:
    """Refuse to begin where no worker can start.

    Raises:
        ProcessError: If the operating system is not Linux.
    """
    if not HAS_WORKERS:
        raise ProcessError(
            "worker processes need Linux; on this system use one process: workers=0, and"
            " num_workers=0 of a vector"
        )


def start(work: Callable[..., None], *arguments: Any, with_main: bool = True) -> BaseProcess:
    """Start a daemonic process that ends with this one, however this one ends.

    It never sees Ctrl-C: a terminal sends it to all, one is to act on it. A daemonic process may
    start some as well, as they do not outlive it.

    Args:
        work: What it runs, a function of a module.
        arguments: What that is called with; can be pickled.
        with_main: Whether it imports this process's main module, as it must to load anything that
            is defined there.

    Raises:
        ProcessError: If descriptors, processes or memory run out, or the main module does not
            guard what it runs.
    """
    result: Future[BaseProcess] = Future()
    _starter().put((functools.partial(_start, work, arguments, with_main), result))
    with enough():
        try:
            process = result.result()
        finally:
            wait([result])  # Ctrl-C must not close what is on its way to the process
    _started.add(process)
    return process


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


def exit_code(process: BaseProcess) -> int | None:
    """Return the exit code of a process, negative if a signal ended it; None while it runs."""
    with _lock:
        return process.exitcode


def end_with_parent() -> None:
    """Let this process be killed with the one that forked it, whatever either is doing."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _start(work: Callable[..., None], arguments: tuple[Any, ...], with_main: bool) -> BaseProcess:
    """Start a process, in the thread that starts all of them."""
    global _server_is_inherited
    _expect_descriptors()
    try:
        get_preparation_data("worker")
    except RuntimeError:  # of a process that is still importing its main module
        raise ProcessError(
            "this script starts workers when it is imported, which every worker does; put what it"
            " runs under `if __name__ == '__main__':`"
        ) from None
    resource_tracker.ensure_running()  # unblocks SIGINT, so it comes first
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # so do those that this one starts
    if _server_is_inherited:  # a fork cannot use the server of its parent
        reload(forkserver)
        _server_is_inherited = False
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["robot_layouts.core.processes.server"])
    process = context.Process(
        target=_begin,
        args=(dict(os.environ), os.sched_getaffinity(0), work, arguments),
        daemon=True,
    )
    for pause in (*_PAUSES, None):
        with _server_environment():
            forkserver.ensure_running()
        try:
            with _lock, _able_to_start(with_main):
                process.start()
            break
        except (EOFError, ConnectionError):
            if pause is None:
                raise ProcessError(
                    "the process that forks workers ended, for the reason that it printed"
                ) from None
            time.sleep(pause)
    return process


def _expect_descriptors() -> None:
    """Refuse to begin what needs more file descriptors than there are.

    The server would end with a process that runs out of them while it asks for a fork, and all
    workers with the server.

    Raises:
        OSError: If there are too few.
    """
    with ExitStack() as spare:
        for _ in range(_DESCRIPTORS):
            spare.callback(os.close, os.open(os.devnull, os.O_RDONLY))


def _begin(
    environment: dict[str, str],
    cores: set[int],
    work: Callable[..., None],
    arguments: tuple[Any, ...],
) -> None:
    """Be a worker."""
    end_with_parent()
    parent = multiprocessing.parent_process()
    if parent is None or not parent.is_alive():
        os._exit(1)
    os.environ.clear()
    os.environ.update(environment)
    os.sched_setaffinity(0, cores)
    if numpy := sys.modules.get("numpy"):
        numpy.random.seed()  # forks would all draw the same numbers
    work(*arguments)


@contextmanager
def _server_environment() -> Generator[None]:
    """Set what the server begins with: one thread for sums, and where modules are found."""
    changed = {
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(sys.path),  # Python before 3.13 forgets it
        "PYTHONSAFEPATH": "1",  # else the present folder's files hide those of this library
        SERVER_OF: str(os.getpid()),
        PRELOAD: " ".join(_preloaded),
    }
    before = {name: os.environ.get(name) for name in changed}
    os.environ.update(changed)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _able_to_start(with_main: bool) -> Generator[None]:
    """Let `multiprocessing` start processes that it would refuse, or that would fail.

    It fears that children of a daemonic process outlive it, and looks for the file of a main
    module that was read from standard input. It imports a main module by ``__spec__`` or
    ``__file__``.
    """
    this, main = multiprocessing.current_process(), sys.modules["__main__"]
    daemonic, this.daemon = this.daemon, False
    names = ("__file__", "__spec__")
    found = {name: vars(main)[name] for name in names if name in vars(main)}
    if not with_main:
        main.__file__ = main.__spec__ = None
    elif not os.path.exists(found.get("__file__") or ""):
        main.__file__ = None
    try:
        yield
    finally:
        this.daemon = daemonic
        for name in names:
            vars(main).pop(name, None)
        vars(main).update(found)


@functools.cache
def _starter() -> SimpleQueue[_Call]:
    """Return where to ask for processes.

    Linux ends a process with the *thread* that started it, so that thread has to live as long as
    this process.
    """
    calls: SimpleQueue[_Call] = SimpleQueue()
    Thread(target=_start_all, args=(calls,), name="process starter", daemon=True).start()
    return calls


def _start_all(calls: SimpleQueue[_Call]) -> None:
    while True:
        call, result = calls.get()
        try:
            result.set_result(call())
        except BaseException as error:
            result.set_exception(error)
        del call, result  # not kept alive while this waits


def _disown() -> None:
    """Let workers count as ended in a fork, which must neither use nor end those of its parent."""
    global _lock, _server_is_inherited
    _starter.cache_clear()  # threads do not survive a fork
    _lock, _server_is_inherited = RLock(), True
    null = os.open(os.devnull, os.O_RDONLY)
    for process in list(_started):
        with suppress(ValueError):  # it is closed
            os.dup2(null, process.sentinel)  # reads as the end of the process
            exit_code(process)
    os.close(null)


after_fork(_disown)
