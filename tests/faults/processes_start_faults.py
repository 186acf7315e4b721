"""Too little to start workers with, and a server of forks that is gone."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    actions,
    children,
    failure,
    living_workers,
    open_files,
    play_own,
    server_pid,
    session_of,
    vector,
    wait_until,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for more in (0, 2, 4, 9, 18):
        what = f"{more} more file descriptors for 8 workers"
        yield Fault(AREA, what, lambda _, more=more: _few_descriptors(more))
    yield Fault(AREA, "no memory to share", lambda _: _no_shared_memory())
    for megabytes in (0, 4):
        what = f"workers that may take {megabytes} MB more"
        yield Fault(AREA, what, lambda _, more=megabytes: _little_memory(more))
    yield Fault(AREA, "the server is killed before a start", lambda _: _no_server(), GOES_ON)
    yield Fault(AREA, "the server is killed with a vector open", lambda _: _server_lost())


def _few_descriptors(more: int) -> None:
    from tests.tasks.breaking import offered

    server_pid()  # is there already
    with offered():  # so are the tasks, which are looked for in files
        _with_few_descriptors(more)


def _with_few_descriptors(more: int) -> None:
    before, open_before = children(), open_files()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (open_before + more, hard))
    try:
        with vector(num_envs=8, num_workers=8):
            raise AssertionError("8 workers with so few descriptors")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert children() == before
        assert open_files() == open_before


def _no_shared_memory() -> None:
    """Let no file grow: memory that processes share is one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before, open_before = children(), open_files()
    before_signal = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, hard))
    try:
        with vector(num_workers=2):
            raise AssertionError("memory was shared")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before_signal)
        assert children() == before
        assert open_files() == open_before


@contextmanager
def _server_may_take(more: int) -> Generator[None]:
    """Let the server and its forks have so much address space more (bytes)."""
    server = server_pid()
    pages = int(Path(f"/proc/{server}/statm").read_text().split()[0])
    limit = max(1, pages * resource.getpagesize() + more)
    hard = resource.prlimit(server, resource.RLIMIT_AS)[1]
    resource.prlimit(server, resource.RLIMIT_AS, (limit, hard))
    try:
        yield
    finally:
        resource.prlimit(server, resource.RLIMIT_AS, (resource.RLIM_INFINITY, hard))


def _little_memory(megabytes: int) -> None:
    with _server_may_take(megabytes * 2**20), vector(num_envs=64, num_workers=2) as env:
        for _ in range(5):
            env.reset(options={"reconfigure": True})
            env.step(actions(env))


def _no_server() -> None:
    server = server_pid()
    os.kill(server, signal.SIGKILL)
    play_own()
    assert server_pid() != server


def _server_lost() -> None:
    server = server_pid()
    with vector(num_workers=2) as env:
        env.reset(seed=4)
        pids = living_workers(env)
        os.kill(server, signal.SIGKILL)
        wait_until(lambda: not any(map(session_of, pids)), "the workers outlive the server")
        error = failure(lambda: env.step(actions(env)))
        assert error.env_ids == [0, 1]
        env.restart()
        assert env.step(actions(env))[0].tobytes() == play_own()
        raise error
