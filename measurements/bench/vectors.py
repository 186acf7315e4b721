"""Rates of vectors on two cores, in lockstep and asynchronous, quiet and disturbed."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from typing import Any

import numpy as np

from measurements.bench.measurement import Measurement, by_series
from measurements.bench.processes import (
    PhysicsProcesses,
    TimedAsynchronously,
    TimedVector,
    vector,
)
from measurements.bench.settings import Settings
from measurements.bench.steps import PHYSICS
from tasks.processes.transport import packed
from tasks.processes.worker import Pool

PROCESSES = 2  # of every vector
HERE, ASYNCHRONOUS, NATIVE = "here", "asynchronous", "native"

NativeVector = Callable[[str], AbstractContextManager[Any]]
"""Gives another vector of a task, of `PROCESSES` environments; None where there is none."""


def vectors(settings: Settings, native: NativeVector | None = None) -> Measurement:
    """Measure vectors beside the physics that as many processes do alone.

    Args:
        settings: How to measure.
        native: What else to measure.
    """
    share, batch = settings.worker_envs, PROCESSES * settings.worker_envs // 2
    samples: dict[tuple[str, str], list[float]] = {}
    values: list[str] = []
    for task_id in settings.vector_tasks:
        with ExitStack() as stack:
            num_envs = PROCESSES * share
            making = settings.making
            lockstep = stack.enter_context(vector(task_id, num_envs, PROCESSES, **making))
            asynchronous = stack.enter_context(
                vector(task_id, num_envs, PROCESSES, batch_size=batch, **making)
            )
            other = stack.enter_context(nullcontext() if native is None else native(task_id))
            floor = stack.enter_context(PhysicsProcesses(task_id, PROCESSES, share, making))
            clock, steps = settings.clock, settings.batch_steps
            timed = TimedVector(lockstep, clock, steps)
            rates = {HERE: timed.rate}
            rates[ASYNCHRONOUS] = TimedAsynchronously(asynchronous, clock, steps).rate
            if other is not None:
                rates[NATIVE] = TimedVector(other, clock, steps).rate
            rates[PHYSICS] = lambda number, timed=timed, floor=floor: floor.rate(timed, number)
            disturber = stack.enter_context(busy_core())
            disturbed = f"{task_id}, one core disturbed"
            variants = {(name, task_id): rate for name, rate in rates.items()}
            variants |= {(name, disturbed): disturber.beside(rate) for name, rate in rates.items()}
            samples.update(settings.interleave(variants, part=1 / len(settings.vector_tasks)))
            values += [task_id, disturbed]
    return Measurement(
        name="vector",
        title=f"Rate of {PROCESSES} × {share} environments; asynchronous: {batch} are received at a"
        f" time; native: AsyncVectorEnv of {PROCESSES}",
        unit=settings.clock.rate_unit,
        variable="task",
        values=tuple(values),
        samples=by_series(values, samples),
        floors=(PHYSICS,),
        ratios=(
            *([(HERE, NATIVE)] if native is not None else []),
            (HERE, PHYSICS),
            (ASYNCHRONOUS, PHYSICS),
        ),
    )


class Disturber:
    """A process that keeps one core busy, whenever it is let."""

    def __init__(self, pid: int) -> None:
        """Take the process, which is stopped."""
        self._pid = pid

    def beside(self, sample: Callable[[int], float]) -> Callable[[int], float]:
        """Return what takes a sample while the core is busy."""

        def disturbed(number: int) -> float:
            os.kill(self._pid, signal.SIGCONT)
            try:
                return sample(number)
            finally:
                os.kill(self._pid, signal.SIGSTOP)

        return disturbed


@contextmanager
def busy_core() -> Generator[Disturber]:
    """Give a process that can keep one of this process's cores busy, and end it."""
    pool = Pool()
    worker = pool.spawn(packed(_turner))
    try:
        pool.results([worker])
        worker.request()
        os.kill(worker.pid, signal.SIGSTOP)
        yield Disturber(worker.pid)
    finally:
        pool.remove(worker)


def _turner() -> Callable[[], None]:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    return _turn


def _turn() -> None:
    """Count for ever, on one core."""
    while True:
        np.zeros(1000).sum()
