"""Workers of a vector whose tasks break, that are killed, stopped, or closed while they hang."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    PATIENCE,
    TASK,
    actions,
    children,
    failure,
    later,
    living_workers,
    same_rows,
    vector,
    worker_pid,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _tasks_that_break()
    yield from _workers_that_end()


# -- tasks that break -----------------------------------------------------------------------------


def _tasks_that_break() -> Iterator[Fault]:
    from tests.tasks.breaking import HOOKS, WAYS

    for hook in HOOKS:
        what = f"a task's {hook}() fails when a worker makes it"
        if hook not in ("dense_reward", "respond"):
            yield Fault(AREA, what, lambda _, hook=hook: _breaks(f"Breaks_{hook}_soon-v1"))
        if hook != "begin_episodes":
            what = f"a task's {hook}() fails in a worker later"
            yield Fault(AREA, what, lambda _, hook=hook: _breaks(f"Breaks_{hook}_late-v1"))
    for number, way in enumerate(WAYS):
        what = f"evaluate() ends with {way} in a worker"
        yield Fault(AREA, what, lambda _, number=number: _breaks(f"BreaksBy_{number}-v1"))
        what = f"evaluate() ends with {way} in one of two workers, and the other goes on"
        yield Fault(AREA, what, lambda _, n=number: _goes_on(f"BreaksBy_{n}-v1"), GOES_ON)
    yield Fault(AREA, "evaluate() has more keys than at first", lambda _: _breaks("Grows-v1"))


def _breaks(task_id: str) -> None:
    """Play until it fails, and see that the error says where and that nothing is left."""
    before = children()
    try:
        with vector(task_id) as env:
            env.step(actions(env))
            env.step(actions(env))
            env.reset(options={"reconfigure": True})
    except RuntimeError as error:
        message, cause = str(error), str(error.__cause__)
        assert "environments [0, 1] of seeds [" in message, message
        assert "__main__" not in message, "a hint that leads nowhere"
        dead = "died by" in message or "ended with code" in message
        assert dead or ("failed in " in message and "Traceback" in cause), message
        raise
    finally:
        assert children() == before


def _goes_on(task_id: str) -> str:
    """Break in one worker alone: the other has taken the step."""
    with vector(task_id, num_workers=2) as env, vector(TASK, num_workers=0) as same:
        env.reset(seed=7)
        same.reset(seed=7)
        error = failure(lambda: env.step(actions(env)))
        assert error.env_ids == [0], error
        assert error.seeds == [7], error
        same_rows(error.results, same.step(actions(same)), [1])
        env.restart()
        assert len(living_workers(env)) == 2
    return str(error)


# -- workers that end -----------------------------------------------------------------------------


SIGNALS = ("SIGKILL", "SIGTERM", "SIGSEGV", "SIGABRT", "SIGHUP", "SIGQUIT")
MOMENTS = (0.0, 0.15, 0.6)  # s after a call has begun that takes 0.2 s or more


def _workers_that_end() -> Iterator[Fault]:
    for name in SIGNALS:
        what = f"a worker ends by {name} between two steps"
        yield Fault(AREA, what, lambda _, name=name: _ends_between_steps(name), GOES_ON)
    for seconds in MOMENTS:
        what = f"a worker is killed {seconds:g} s after the first of slow steps has begun"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_in_steps(s), GOES_ON)
        what = f"a worker is killed {seconds:g} s after vectors are made"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_while_made(s))
        what = f"a worker is killed {seconds:g} s after worlds are rebuilt"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_in_rebuild(s))
    yield Fault(AREA, "a worker is stopped for ever", lambda _: _hangs(TASK, stopped=True))
    yield Fault(AREA, "a worker hangs in C code", lambda _: _hangs("BusySteps-v1", stopped=False))
    yield Fault(AREA, "a worker is stopped for a while", lambda _: _stopped_for_a_while(), GOES_ON)
    yield Fault(AREA, "all workers are killed at once", lambda _: _all_killed())
    yield Fault(AREA, "a vector is closed while a worker is stopped", lambda _: _closes(), GOES_ON)
    yield Fault(AREA, "a worker dies whose own child lives on", lambda _: _leaves_a_child())
    yield Fault(AREA, "closed in C code that never ends", lambda _: _closes_busy(), GOES_ON)


def _ends_between_steps(name: str) -> str:
    with vector(num_workers=2) as env, vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
            each.step(actions(each))
        os.kill(worker_pid(env, 0), signal.Signals[name])
        error = failure(lambda: env.step(actions(env)))
        assert f"died by {name}" in str(error), error
        same_rows(error.results, same.step(actions(same)), [1])
        env.restart()
        obs, *_ = env.step(actions(env))
        assert obs.shape[0] == 2
    return str(error)


def _killed_in_steps(seconds: float) -> str:
    with vector("SlowSteps-v1", num_workers=2) as env, vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
        env.step(actions(env))
        same.step(actions(same))
        error = None
        with later(seconds, lambda: os.kill(worker_pid(env, 0), signal.SIGKILL)):
            while error is None:
                wanted = same.step(actions(same))
                try:
                    same_rows(env.step(actions(env)), wanted, [0, 1])
                except RuntimeError as raised:
                    error = raised
        assert getattr(error, "env_ids", None) == [0], error
        same_rows(error.results, wanted, [1])  # type: ignore[attr-defined]
    return str(error)


def _killed_while_made(seconds: float) -> None:
    """Kill workers after some time, until a vector that is made again and again meets one's end."""
    before, over = children(), threading.Event()

    def kill() -> None:
        while not over.wait(0.001):
            for pid in children() - before:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    with later(seconds, kill):
        try:
            while True:
                with vector("SlowBuild-v1", num_workers=2) as env:
                    for _ in range(5):
                        env.step(actions(env))
        finally:
            over.set()


def _killed_in_rebuild(seconds: float) -> None:
    with (
        vector("SlowBuild-v1", num_workers=2) as env,
        later(seconds, lambda: os.kill(worker_pid(env, 0), signal.SIGKILL)),
    ):
        while True:
            env.reset(options={"reconfigure": True})


def _hangs(task_id: str, *, stopped: bool) -> None:
    with vector(task_id, num_workers=2, timeout=1.0) as env:
        env.reset()
        if stopped:
            os.kill(worker_pid(env, 1), signal.SIGSTOP)
        begun = time.monotonic()
        try:
            env.step(actions(env))
        finally:
            assert time.monotonic() - begun < PATIENCE


def _stopped_for_a_while() -> None:
    with vector(num_workers=2) as env, vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
        pid = worker_pid(env, 0)
        os.kill(pid, signal.SIGSTOP)
        with later(0.5, lambda: os.kill(pid, signal.SIGCONT)):
            same_rows(env.step(actions(env)), same.step(actions(same)), [0, 1])


def _all_killed() -> None:
    with vector(num_workers=2) as env:
        for pid in living_workers(env):
            os.kill(pid, signal.SIGKILL)
        error = failure(lambda: env.step(actions(env)))
        assert error.env_ids == [0, 1]
        env.restart()
        env.step(actions(env))
        raise error


def _closes() -> None:
    before = children()
    with vector(num_workers=2) as env:
        os.kill(worker_pid(env, 0), signal.SIGSTOP)
    assert children() == before


def _closes_busy() -> None:
    before = children()
    with vector("BusySteps-v1", num_workers=2, timeout=1.0) as env:
        failure(lambda: env.step(actions(env)))
    assert children() == before


def _leaves_a_child() -> None:
    """A child of the worker holds the worker's connection open."""
    with vector("Forks-v1", 1) as env:
        env.reset()
        os.kill(worker_pid(env, 0), signal.SIGKILL)
        error = failure(lambda: env.step(actions(env)))
        assert "died by SIGKILL" in str(error), error
        raise error
