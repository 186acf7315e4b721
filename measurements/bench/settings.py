"""How a run of benchmarks measures: with which clock, how often, and how much of everything."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from measurements.bench.measurement import Key, Measurement, interleave

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Clock:
    """Time that goes by, or time that processors spend, which other programs disturb less.

    Attributes:
        processor: Whether it is the latter.
    """

    processor: bool = False

    def now(self, others: Iterable[int] = ()) -> float:
        """Return the time (s) since some moment.

        Args:
            others: Processes, by id, whose processor time counts as well as this one's.
        """
        if not self.processor:
            return time.perf_counter()
        return time.process_time() + sum(map(_processor_seconds, others))

    @property
    def rate_unit(self) -> str:
        """Unit of `rate` where environments are stepped."""
        return "environment steps per second" + " of processor time" * self.processor

    def rate(self, work: Iterable[tuple[float, float]]) -> float:
        """Return how much is done per second by all of several processes that run at once.

        Args:
            work: What each has done, and the seconds that it took.
        """
        work = list(work)
        if self.processor:
            return sum(done for done, _ in work) / sum(seconds for _, seconds in work)
        return sum(done / seconds for done, seconds in work)

    def __str__(self) -> str:
        """Say which one it is."""
        return "processor time of all processes" if self.processor else "time that went by"


@dataclass(frozen=True)
class Settings:
    """What the benchmarks of a run have in common.

    Attributes:
        clock: What they measure with.
        rounds: Samples of each.
        tick: Called with the share of a benchmark that was just done.
        tasks: Task ids; benchmarks that take one task alone take the first.
        steps: Control steps of a sample of one environment.
        batch_steps: Control steps of a sample of many.
        environments: Numbers of environments in one process.
        workers: Numbers of worker processes; 0 is this process.
        worker_envs: Environments of each worker.
        robots: Numbers of robots.
        kinds: Robots by name, which take turns in the mixed rings.
        cubes: Numbers of cubes that touch.
        started: Numbers of environments whose start is timed.
        episodes: Episodes of a recording.
        checked: Numbers of robots whose layout is validated.
        vector_tasks: Task ids of which vectors are measured.
        making: Arguments of `tasks.make`, with which the tasks are made.
    """

    clock: Clock = Clock()
    rounds: int = 12
    tick: Callable[[float], None] = lambda share: None
    tasks: tuple[str, ...] = ("PickCube-v1", "TwoRobotPickCube-v1", "PushT-v1")
    steps: int = 50
    batch_steps: int = 25
    environments: tuple[int, ...] = (1, 4, 16, 64)
    workers: tuple[int, ...] = (0, *(2**k for k in range(3) if 2**k <= CORES))
    worker_envs: int = 32
    robots: tuple[int, ...] = (1, 2, 4, 8)
    kinds: tuple[str, ...] = ("panda", "so100", "panda_stick")
    cubes: tuple[int, ...] = (0, 8, 16, 32, 64)
    started: tuple[int, ...] = (1, 64)
    episodes: int = 12
    checked: tuple[int, ...] = (1, 2, 4)
    vector_tasks: tuple[str, ...] = ("PickCube-v1", "TwoRobotPickCube-v1", "FourRobotStack-v1")
    making: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def interleave(
        self,
        variants: Mapping[Key, Callable[[int], float]],
        *,
        part: float = 1.0,
        rounds: int | None = None,
        warm_up: bool = True,
    ) -> dict[Key, list[float]]:
        """Take samples of variants in turns; see `measurements.bench.measurement.interleave`.

        Args:
            variants: Takes the number of the round and returns a sample.
            part: Share of the whole benchmark that they are.
            rounds: Samples of each, where not as many as of everything else.
            warm_up: Whether the first round does not count.
        """
        rounds = self.rounds if rounds is None else rounds
        return interleave(variants, rounds, lambda share: self.tick(share * part), warm_up=warm_up)


@dataclass(frozen=True)
class Benchmark:
    """Something that can be measured.

    Attributes:
        answers: What it tells, in a few words.
        measure: Does it.
    """

    answers: str
    measure: Callable[[Settings], Measurement]


def _processor_seconds(pid: int) -> float:
    return time.clock_gettime(~pid << 3 | 2)  # as clock_getcpuclockid(3) composes it on Linux
