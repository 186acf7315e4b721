"""A vector whose environments are sent actions and received: stopped or killed meanwhile."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    actions,
    failure,
    later,
    living_workers,
    vector,
    wait_until,
    worker_pid,
)

ENVS = 4  # two for each worker


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, use in _IN_THE_MIDDLE.items():
        yield _fault(f"{what} while another thread waits in recv()", _beside_recv(use))
    yield _fault("a worker is killed before recv()", _killed)
    yield _fault("a worker is stopped for longer than its time before recv()", _stopped)
    yield _fault("a worker is stopped for a while before recv()", _continued, GOES_ON)


def _fault(what: str, use: Callable[[Any], Any], promise: str | None = None) -> Fault:
    def run(_: object) -> None:
        with vector(num_envs=ENVS, num_workers=2, batch_size=2, timeout=3.0) as env:
            env.reset(seed=7)
            use(env)

    return Fault(AREA, what, run, promise) if promise else Fault(AREA, what, run)


def _send(env: Any, ids: list[int]) -> None:
    env.send(np.full((len(ids), 8), 0.2, np.float32), ids)


_IN_THE_MIDDLE: Mapping[str, Callable[[Any], Any]] = {
    "send()": lambda env: env.send(actions(env)[:1], [3]),
    "recv()": lambda env: env.recv(),
    "close()": lambda env: env.close(),
}


def _beside_recv(use: Callable[[Any], Any]) -> Callable[[Any], None]:
    def run(env: Any) -> None:
        pids = living_workers(env)
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        _send(env, [0, 1])
        results: list[Any] = []
        thread = threading.Thread(target=lambda: results.append(env.recv()))
        thread.start()
        wait_until(env.busy.locked, "the other thread does not wait")
        try:
            use(env)
        finally:
            for pid in pids:
                os.kill(pid, signal.SIGCONT)
            thread.join()
            assert results[0][-1]["env_id"].tolist() == [0, 1], "the first call was disturbed"

    return run


def _killed(env: Any) -> None:
    _expect_the_others(env, lambda pid: os.kill(pid, signal.SIGKILL))


def _stopped(env: Any) -> None:
    _expect_the_others(env, lambda pid: os.kill(pid, signal.SIGSTOP))


def _expect_the_others(env: Any, harm: Callable[[int], None]) -> None:
    """Do a worker some harm: the other one's environments come, and after `restart` all step."""
    os.kill(worker_pid(env, 1), signal.SIGSTOP)
    _send(env, [0, 1, 2, 3])
    harm(worker_pid(env, 1))
    assert env.recv()[-1]["env_id"].tolist() == [0, 1]
    error = failure(lambda: env.recv())
    assert error.env_ids == [2, 3]
    env.restart()
    env.step(actions(env))
    raise error


def _continued(env: Any) -> None:
    with vector(num_envs=ENVS, num_workers=0) as same:
        same.reset(seed=7)
        expected = same.step(actions(same))
    pid = worker_pid(env, 0)
    os.kill(pid, signal.SIGSTOP)
    with later(0.5, lambda: os.kill(pid, signal.SIGCONT)):
        _send(env, [0, 1, 2, 3])
        for ids in ([2, 3], [0, 1]):
            *results, info = env.recv()
            assert info["env_id"].tolist() == ids
            for result, wanted in zip(results, expected, strict=False):
                np.testing.assert_array_equal(result, wanted[ids])
