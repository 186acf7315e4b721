"""How faults ask for episodes, and players that do some mischief."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from tests.faults.fault import Fault

AREA = "workers and Ray"
TASK = "PushT-v1"


def fault_of(what: str, run: Callable[..., None], **arguments: Any) -> Fault:
    """Return the fault that a call with some arguments is."""
    return Fault(AREA, what, lambda folder: run(**arguments))


def evaluated(policy: Any = len, seeds: Any = (0,), workers: Any = 1, **arguments: Any) -> None:
    """Evaluate a policy."""
    from robot_layouts.data import evaluate

    if arguments.get("executor") is None or workers is not None:
        arguments["workers"] = workers
    evaluate(policy, TASK, seeds, **arguments)


def recorded(
    seeds: Any = (0,), folder: Path = Path("/nowhere"), workers: Any = 1, **arguments: Any
) -> None:
    """Record episodes of an expert that moves at random."""
    from robot_layouts.data.recording.record import record
    from tests.data.plays import at_random

    with patch.dict("robot_layouts.experts.registry.EXPERTS.registered", {TASK: at_random}):
        record(TASK, seeds, folder, workers=workers, **arguments)


def process_executor(**arguments: Any) -> None:
    """Make one."""
    from robot_layouts.data.playing.executor import ProcessExecutor

    ProcessExecutor(**arguments)


def ray_executor(**arguments: Any) -> None:
    """Make one."""
    from robot_layouts.data.playing.ray_executor import RayExecutor

    RayExecutor(**arguments)


class Nobody:
    """An executor that does not play what it is asked."""

    what = "plays nothing"

    def run(self, prepare: Any, seeds: Any) -> Any:
        """Play, after a fashion."""
        from robot_layouts.core.processes.start import WorkerError
        from robot_layouts.data.playing.executor import InProcessExecutor
        from robot_layouts.data.playing.scheduler import Event

        if self.what == "forgets one":
            yield from InProcessExecutor().run(prepare, seeds[1:])
        elif self.what == "raises":
            raise WorkerError("nobody is here to play")
        elif self.what == "answers for others":
            yield Event(77, result=3)
        elif self.what == "plays nothing":
            yield Event(None, note="I rest")


class Elsewhere:
    """A policy that no other process can load."""

    def __call__(self, obs: Any) -> None: ...

    def __reduce__(self) -> Any:
        from importlib import import_module

        return import_module, ("no_such_module_of_mine",)


@dataclass(frozen=True)
class Mischief:
    """Plays squares; does some mischief once, or again and again."""

    folder: Path
    what: str
    during: str
    again: bool = False

    def __call__(self) -> Callable[[int], int]:
        """Begin."""
        self._perhaps("begin")
        return self.play

    def play(self, seed: int) -> int:
        """Return the square of a seed."""
        if seed == 1:
            self._perhaps("play")
        return seed**2

    def _perhaps(self, when: str) -> None:
        mark = self.folder / "done"
        if when == self.during and (self.again or not mark.exists()):
            mark.touch()
            _do(self.what, self.folder)


def _do(what: str, folder: Path) -> None:
    kind, _, detail = what.partition(" ")
    if kind == "signal":
        os.kill(os.getpid(), getattr(signal, detail))
    elif kind == "nap":
        pid = os.getpid()
        if os.fork() == 0:
            time.sleep(0.5)
            os.kill(pid, signal.SIGCONT)
            os._exit(0)
        os.kill(pid, signal.SIGSTOP)
    elif kind == "exit":
        os._exit(int(detail))
    elif kind == "busy":
        while True:
            pass
    elif kind == "lock":
        lock = threading.Lock()
        lock.acquire()
        lock.acquire()
    elif kind == "sleep":
        threading.Event().wait()
    elif kind == "fifo":
        os.mkfifo(folder / "fifo")
        (folder / "fifo").read_bytes()
    elif kind == "half":
        from tests.data.plays import StopsHalfWay

        StopsHalfWay(folder).play(0)


def expect_squares(executor: Any, prepare: Any, deaths: int = 1) -> str:
    """Play four squares, and see that each comes once although a player died."""
    events = list(executor.run(prepare, range(4)))
    results = [(event.seed, event.result) for event in events if event.result is not None]
    assert sorted(results) == [(seed, seed**2) for seed in range(4)], results
    died = [event.died for event in events if event.died is not None]
    assert len(died) == deaths, died
    return f"{died[0] if died else 'nobody dies'}; all four episodes are played, each once"
