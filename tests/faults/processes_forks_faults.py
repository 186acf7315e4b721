"""Forks of a process that has a vector with workers."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    PATIENCE,
    USES,
    actions,
    living_workers,
    play_own,
    run_script,
    vector,
)

ENDS = {
    "sys.exit": "sys.exit(0)",
    "an error": "raise ValueError('on purpose')",
}
SUDDEN_ENDS: dict[str, Callable[[Any], Any]] = {
    "os._exit": lambda env: None,
    "os._exit, having let it be collected": lambda env: vars(env).clear(),
    "multiprocessing's own ending": lambda env: _end_of_multiprocessing(),
}
FORKING = """
import os, sys, time
import numpy as np
from tasks.interfaces.vector import VectorTask
if __name__ == "__main__":
    env = VectorTask("PushCube-v1", 2, num_workers=2)
    one = VectorTask("PushCube-v1", 2, num_workers=0)
    if not os.fork():
        {end}
    os.wait()
    for each in (env, one):
        each.reset(seed=1)
    for _ in range(3):
        action = np.zeros((2, 8), np.float32)
        assert (env.step(action)[0] == one.step(action)[0]).all()
    env.close()
"""


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, use in USES.items():
        what = f"{name} of a vector with workers in a fork"
        yield Fault(AREA, what, lambda _, use=use: _used_in_fork(use))
        what = f"{name} of a vector without workers in a fork"
        yield Fault(AREA, what, lambda _, use=use: _used_in_fork(use, workers=0), GOES_ON)
    for name, end in ENDS.items():
        what = f"a fork ends by {name} while a vector is open"
        yield Fault(AREA, what, lambda folder, end=end: _fork_ends(folder, end), GOES_ON)
    for name, last in SUDDEN_ENDS.items():
        what = f"a fork ends by {name}, while a vector is open"
        yield Fault(AREA, what, lambda _, last=last: _fork_ends_suddenly(last), GOES_ON)
    yield Fault(AREA, "a vector of its own in a fork", lambda _: _own_in_fork(), GOES_ON)
    yield Fault(AREA, "a vector in a process by fork", lambda _: _in_process_by("fork"), GOES_ON)
    yield Fault(AREA, "a vector in a process by spawn", lambda _: _in_process_by("spawn"), GOES_ON)


def _used_in_fork(use: Callable[[Any], Any], workers: int = 2) -> None:
    with vector(num_workers=workers) as env:
        env.reset(seed=2)
        try:
            _in_fork(lambda: (use(env), None)[1])
        finally:
            if workers:
                assert len(living_workers(env)) == workers
            env.step(actions(env))


def _fork_ends(folder: Path, end: str) -> None:
    done = run_script(folder, FORKING.format(end=end))
    assert done.returncode == 0, done.stderr[-2000:]
    expected = "ValueError: on purpose" if "raise" in end else ""
    last = (done.stderr.strip().splitlines() or [""])[-1]
    assert last == expected, done.stderr[-2000:]


def _fork_ends_suddenly(last: Callable[[Any], Any]) -> None:
    with vector(num_workers=2) as env:
        env.reset(seed=4)
        pid = os.fork()
        if pid == 0:
            last(env)
            os._exit(0)
        os.waitpid(pid, 0)
        assert env.step(actions(env))[0].tobytes() == play_own()


def _end_of_multiprocessing() -> None:
    from multiprocessing import util

    util._exit_function()  # type: ignore[attr-defined]


def _own_in_fork() -> None:
    with vector(num_workers=2) as env:
        env.reset(seed=4)
        wanted = env.step(actions(env))[0].tobytes()
        assert _in_fork(play_own) == wanted


def _in_process_by(method: str) -> None:
    context: Any = multiprocessing.get_context(method)
    ours, theirs = context.Pipe()
    process = context.Process(target=_send_own, args=(theirs,), daemon=True)
    process.start()
    assert ours.poll(90)
    assert ours.recv() == play_own()
    process.join(PATIENCE)
    assert process.exitcode == 0


def _send_own(connection: Any) -> None:
    connection.send(play_own())


def _in_fork(call: Callable[[], Any]) -> Any:
    """Call something in a fork, and return or raise here what it does there."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.alarm(60)
        try:
            answer = call(), None
        except Exception as error:
            answer = None, error
        os.write(write, pickle.dumps(answer))
        os._exit(0)
    os.close(write)
    with open(read, "rb") as pipe:
        told = pipe.read()
    os.waitpid(pid, 0)
    assert told, "the fork hung, or died without a word"
    result, error = pickle.loads(told)
    if error is not None:
        raise error
    return result
