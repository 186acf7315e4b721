"""A vector that several threads call, that Ctrl-C interrupts, that is copied and pickled."""

from __future__ import annotations

import copy
import pickle
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import gymnasium

import tasks
from robots import RobotLayoutsError, SimulationError
from tasks.interfaces.vector import VectorTask
from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    PATIENCE,
    TASK,
    USES,
    actions,
    living_workers,
    open_files,
    play_own,
    vector,
    wait_until,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _copies()
    for name, use in {**USES, "close()": lambda env: env.close()}.items():
        for workers in (0, 2):
            what = f"{name} while another thread steps a vector of {workers} workers"
            yield Fault(AREA, what, lambda _, use=use, workers=workers: _collide(use, workers))
    yield Fault(AREA, "four threads step one vector", lambda _: _four_threads(), GOES_ON)
    yield Fault(AREA, "Ctrl-C again and again", lambda _: _interrupted(), GOES_ON)


def _collide(use: Callable[[Any], Any], workers: int) -> None:
    with vector("SlowSteps-v1", num_workers=workers) as env:
        env.step(actions(env))
        results: list[Any] = []
        thread = threading.Thread(target=lambda: results.append(env.step(actions(env))))
        thread.start()
        wait_until(env.busy.locked, "the other thread does not step")
        try:
            use(env)
        finally:
            thread.join(PATIENCE)
            assert results, "the first call was disturbed"
            env.step(actions(env))


def _four_threads() -> str:
    steps, refused = [0] * 4, [0] * 4
    with vector("SlowSteps-v1", num_workers=2) as env:
        env.reset(seed=1)

        def play(number: int) -> None:
            for _ in range(5):
                try:
                    env.step(actions(env))
                    steps[number] += 1
                except SimulationError:
                    refused[number] += 1

        _run_threads(play)
        _, info = env.reset(seed=1)
        assert sum(steps) >= 1
        assert sum(refused) >= 1
        assert len(living_workers(env)) == 2
        assert info["elapsed_steps"].tolist() == [0, 0]
    return f"{sum(steps)} steps taken, {sum(refused)} refused"


def _run_threads(target: Callable[[int], Any]) -> None:
    threads = [threading.Thread(target=target, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
        assert not thread.is_alive(), "a thread hangs"


def _interrupted() -> None:
    """Interrupt steps at many moments: the vector stays of use."""
    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        interrupts.append(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with vector(num_workers=2) as env:
            env.reset(seed=1)
            for i in range(40):
                with suppress(KeyboardInterrupt):
                    signal.setitimer(signal.ITIMER_REAL, 1e-4 * (i + 1))
                    while len(interrupts) == i:
                        env.step(actions(env))
            env.reset(seed=4)
            assert env.step(actions(env))[0].tobytes() == play_own()
            assert len(living_workers(env)) == 2
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


# -- copies ---------------------------------------------------------------------------------------


COPIES: dict[str, Callable[[Any], Any]] = {
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


FRONTS: dict[str, Callable[[], Any]] = {
    "a vector with workers": lambda: VectorTask(TASK, 2, num_workers=2),
    "a vector without workers": lambda: VectorTask(TASK, 2, num_workers=0),
    "a Gymnasium environment": lambda: gymnasium.make(f"RobotLayouts/{TASK}"),
    "a PettingZoo environment": lambda: tasks.parallel_env(TASK),
    "a Stable-Baselines3 environment": lambda: tasks.sb3_vec_env(TASK, 2, num_workers=0),
    "a task": lambda: tasks.make(TASK, num_envs=2),
}


def _copies() -> Iterator[Fault]:
    for front in FRONTS:
        for name, make_copy in COPIES.items():
            if "Gymnasium" in front and make_copy is copy.copy:
                continue  # a shallow copy of Gymnasium's wrappers shares what they wrap
            what = f"{name} of {front}"
            yield Fault(AREA, what, lambda _, f=front, c=make_copy: _copied(f, c), GOES_ON)
    yield Fault(AREA, "copy.deepcopy of a vector fails", lambda _: _copy_fails(), GOES_ON)


def _copied(front: str, make_copy: Callable[[Any], Any]) -> None:
    """Copy, end the copy, and see that the original goes on and the copy was made alike."""
    original = FRONTS[front]()
    _seed(original)
    other = make_copy(original)
    assert other is not original
    assert type(other) is type(original)
    first = _seed(other)
    other.close()
    assert _seed(original) == first
    original.close()


def _seed(env: Any) -> bytes:
    """Begin an episode of one seed and return what is observed, as bytes."""
    if hasattr(env, "env_is_wrapped"):
        env.seed(11)
        return pickle.dumps(env.reset().tolist())
    obs, _ = env.reset(seed=11)
    if isinstance(obs, dict):
        return pickle.dumps({key: part.tolist() for key, part in obs.items()})
    return pickle.dumps(obs.tolist())


def _copy_fails() -> None:
    played = play_own()
    with vector(num_workers=2) as env:
        env.reset(seed=4)
        room = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (open_files() + 2, room[1]))
        try:
            copy.deepcopy(env)
        except (RuntimeError, RobotLayoutsError):  # whatever needs the next file first
            pass
        else:
            raise AssertionError("nothing failed")
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, room)
        assert env.step(actions(env))[0].tobytes() == played
