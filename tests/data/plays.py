"""What worker processes do in tests; they import this module."""

import os
import pickle
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robot_layouts.core.processes import worker
from robot_layouts.core.processes.worker import report
from robot_layouts.data.playing.scheduler import Event
from robots import TaskError

TASK = "PushT-v1"
BARRIER = "TEST_BARRIER"  # environment variable: a folder where `at_random` waits, if it exists
NO_PLAN = 1007  # a seed that the expert cannot plan


def at_random(task, seed):
    """An expert that costs nothing: it moves at random for a while."""
    wait_for_others()
    if seed == NO_PLAN:
        raise TaskError(f"no plan for seed {seed}")
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (20 + seed % 5, task.layout.action_dim)).astype(np.float32)


def wait_for_others(workers=3):
    """Wait until so many workers have come here, and then a moment, so that they all play on."""
    folder = Path(os.environ.get(BARRIER, "/nowhere"))
    if folder.exists():
        (folder / str(os.getpid())).touch()
        while folder.exists() and len(list(folder.iterdir())) < workers:
            time.sleep(0.01)
        time.sleep(0.1)


@dataclass(frozen=True)
class Play:
    """Return who played which seed; may die, fail or linger at some."""

    folder: Path | None = None
    dies_at: int = -1
    always: bool = False
    fails_at: int = -1
    breaks_at: int = -1
    hangs_at: int = -1
    leaves_at: int = -1
    lasts: float = 0.0  # s
    says: str = ""

    def __call__(self):
        return self.play

    def play(self, seed: int):
        time.sleep(self.lasts)
        if self.says:
            report(self.says)
        if seed == self.dies_at and (self.always or not (self.folder / "died").exists()):
            (self.folder / "died").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if seed == self.hangs_at and (self.always or not (self.folder / "hung").exists()):
            (self.folder / "hung").touch()
            os.kill(os.getpid(), signal.SIGSTOP)
        if seed == self.leaves_at:
            sys.exit("enough")
        if seed == self.fails_at:
            raise TaskError(f"no plan for {seed}")
        if seed == self.breaks_at:
            return 1 / 0
        return os.getpid(), seed**2


@dataclass(frozen=True)
class DiesAmidAnEpisode:
    """Prepares what ``prepare`` does; the first worker to say how far it is dies instead."""

    prepare: Callable[[], Callable[[int], Any]]
    folder: Path

    def __call__(self):
        send = worker.Channel.send

        def send_or_die(channel, number, message):
            if pickle.loads(message)[0] is worker.Status.NOTE:
                try:
                    (self.folder / "died").touch(exist_ok=False)
                except FileExistsError:
                    return send(channel, number, message)
                os.kill(os.getpid(), signal.SIGKILL)
            return send(channel, number, message)

        worker.Channel.send = send_or_die
        return self.prepare()


@dataclass(frozen=True)
class EveryOtherDies:
    """Every other worker dies before it is ready."""

    folder: Path

    def __call__(self):
        begun = len(list(self.folder.iterdir()))
        (self.folder / str(begun)).touch()
        if begun % 2 == 0:
            os._exit(7)
        return Play().play


@dataclass(frozen=True)
class StopsHalfWay:
    """The first worker is stopped while its answer is on the way."""

    folder: Path

    def __call__(self):
        return self.play

    def play(self, seed: int):
        if not (self.folder / "hung").exists():
            (self.folder / "hung").touch()
            channel, number = worker._connection
            channel.socket.send(worker._HEAD.pack(number, 0, 2) + b"half of a reply")
            os.kill(os.getpid(), signal.SIGSTOP)
        return os.getpid(), seed**2


@dataclass(frozen=True)
class SaysAndRests:
    """Says a word again and again, with pauses (s) in between."""

    words: int
    pause: float

    def __call__(self):
        return self.play

    def play(self, seed: int):
        for word in range(self.words):
            report(word)
            time.sleep(self.pause)
        return os.getpid(), seed**2


def makes_what_cannot_be_pickled():
    return lambda seed: lambda: seed


def cannot_prepare():
    raise TaskError("nothing can be made here")


def dies_before_it_is_ready():
    os._exit(7)


class Here:
    """Executor that plays in this very process, in another order than asked for."""

    def run(self, prepare, seeds):
        play = prepare()
        for seed in reversed(seeds):
            yield Event(seed, result=play(seed))


class CodeFolder:
    """Plays that tell where the code of the library lies, in a module that travels along."""

    modules = (__name__,)

    def __call__(self):
        import robot_layouts

        return lambda seed: str(Path(robot_layouts.__file__).parent)
