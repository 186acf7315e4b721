"""Wrong ways to ask for workers, and policies that no worker can play."""

from __future__ import annotations

import functools
import math
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.faults.fault import Fault, run_command
from tests.faults.players import (
    AREA,
    TASK,
    Elsewhere,
    Nobody,
    evaluated,
    fault_of,
    process_executor,
    ray_executor,
    recorded,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _wrong_arguments()
    yield from _wrong_policies()


NO_COUNT = (-1, True, 2.5, "2", math.nan)
NO_SECONDS = (0, True, "5", math.nan, math.inf)
NO_SEEDS = (5, None, [0.5], "ab", [-1], [2**32], [1, 2, 1])


# -- wrong arguments ------------------------------------------------------------------------------


def _wrong_arguments() -> Iterator[Fault]:
    for value in NO_COUNT:
        yield fault_of(f"evaluate(workers={value!r})", evaluated, workers=value)
        yield fault_of(f"record(workers={value!r})", recorded, workers=value)
        yield fault_of(f"RayExecutor(workers={value!r})", ray_executor, workers=value)
        yield fault_of(f"ProcessExecutor(attempts={value!r})", process_executor, attempts=value)
    for value in NO_SECONDS:
        yield fault_of(f"evaluate(episode_timeout={value!r})", evaluated, episode_timeout=value)
        yield fault_of(f"record(episode_timeout={value!r})", recorded, episode_timeout=value)
    for value in NO_SEEDS:
        yield fault_of(f"evaluate(seeds={value!r})", evaluated, seeds=value)
        yield fault_of(f"record(seeds={value!r})", recorded, seeds=value)
    yield fault_of("evaluate(seeds=[])", evaluated, seeds=[])
    yield fault_of("ProcessExecutor(workers=0)", process_executor, workers=0)
    yield fault_of("RayExecutor(workers=0)", ray_executor, workers=0)
    yield fault_of("a deadline in this process", evaluated, workers=0, episode_timeout=5.0)
    yield fault_of("an executor and workers", evaluated, executor=Nobody(), workers=2)
    yield fault_of("an executor and a deadline", evaluated, executor=Nobody(), episode_timeout=5.0)
    for words in (
        ["--workers=-1"],
        ["--episode-timeout=0"],
        ["--workers=0", "--episode-timeout=9"],
        ["--ray=local"],
        ["--ray=127.0.0.77:1"],
    ):
        yield Fault(AREA, f"evaluate {' '.join(words)}", functools.partial(_command, words))


def _command(words: list[str], folder: Path) -> None:
    run_command("robot_layouts", "evaluate", f"--task={TASK}", "--episodes=1", *words)


# -- policies -------------------------------------------------------------------------------------


def _wrong_policies() -> Iterator[Fault]:
    for what, policy in _POLICIES.items():
        yield fault_of(f"a policy that {what}, workers=0", evaluated, policy=policy, workers=0)
    for what in ("raises KeyError", "raises what cannot be pickled"):
        yield fault_of(f"a policy that {what}, workers=1", evaluated, policy=_POLICIES[what])
    yield fault_of("a policy that leaves the process, workers=1", evaluated, policy=_leave)
    for what, make in _UNSENDABLE.items():
        yield Fault(AREA, f"{what} as policy, workers=1", lambda _, make=make: evaluated(make()))


class _Secretive(Exception):
    """Cannot be pickled, nor printed."""

    def __init__(self, secret: object) -> None:
        super().__init__(lambda: secret)

    def __str__(self) -> str:
        raise ValueError("no")


def _raise(error: BaseException, obs: Any) -> None:
    raise error


def _raise_secret(obs: Any) -> None:
    raise _Secretive(obs)


def _leave(obs: Any) -> None:
    sys.exit("enough")


def _recurse(obs: Any) -> Any:
    return _recurse(obs)


_POLICIES: dict[str, Any] = {
    "raises KeyError": functools.partial(_raise, KeyError("no such key")),
    "raises what cannot be pickled": _raise_secret,
    "calls itself for ever": _recurse,
    "returns nothing": lambda obs: None,
    "returns a word": lambda obs: "left",
    "returns too few numbers": lambda obs: [0.0] * 3,
    "returns NaN": lambda obs: [math.nan] * 7,
    "takes no argument": lambda: [0.0] * 7,
}


class _Refuses:
    def __call__(self, obs: Any) -> None: ...

    def __reduce__(self) -> str:
        raise ValueError("I am not to be pickled")


class _Holds:
    def __init__(self, thing: object) -> None:
        self.thing = thing

    def __call__(self, obs: Any) -> None: ...


_UNSENDABLE: dict[str, Callable[[], Any]] = {
    "a lambda": lambda: lambda obs: obs,
    "a lock's holder": lambda: _Holds(threading.Lock()),
    "what refuses to be pickled": _Refuses,
    "what no worker can import": Elsewhere,
}
