"""What observing with cameras costs: vectors that draw, beside SAPIEN's drawing alone."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from measurements.bench.measurement import BenchmarkError, Measurement, by_series
from measurements.bench.processes import VECTOR, TimedVector, vector
from measurements.bench.settings import Clock, Settings
from simulation.rendering.pictures import vulkan_problem
from tasks.processes import process as processes
from tasks.processes.worker import Worker

DRAWING = "SAPIEN's drawing of everything"
WORKERS = 2
OBS_MODE = "rgb"
STEPS, ROUNDS = 2, 5  # a picture takes tens of milliseconds of a processor
DRAWN = 8  # pictures of a process in a round


@dataclass(frozen=True)
class Variant:
    """Something else that observes pictures, beside which the vector is measured.

    Attributes:
        name: Of its series.
        make: Returns its vector, which is closed in the end.
    """

    name: str
    make: Callable[[str], Any]


def pictures(settings: Settings, beside: Variant | None = None) -> Measurement:
    """Measure the rate of a vector that observes pictures, and of drawing alone.

    Args:
        settings: How to measure.
        beside: What is measured in turns with them, if anything.

    Raises:
        BenchmarkError: If nothing can be drawn here.
    """
    if problem := vulkan_problem():
        raise BenchmarkError(f"no pictures can be drawn here: {problem}")
    task_id, count, clock = settings.tasks[0], WORKERS * settings.worker_envs, settings.clock
    with ExitStack() as stack:
        making = {**settings.making, "obs_mode": OBS_MODE}
        own = stack.enter_context(vector(task_id, count, WORKERS, **making))
        variants = {(VECTOR, task_id): TimedVector(own, clock, STEPS).rate}
        if beside is not None:
            other = beside.make(task_id)
            stack.callback(other.close)
            variants[beside.name, task_id] = TimedVector(other, clock, DRAWN).rate
        floor = stack.enter_context(DrawingProcesses(task_id, clock))
        variants[DRAWING, task_id] = floor.rate
        samples = settings.interleave(variants, rounds=min(settings.rounds, ROUNDS))
    names = [DRAWING] if beside is None else [beside.name, DRAWING]
    return Measurement(
        name="pictures",
        title=f"Rate of {WORKERS} × {settings.worker_envs} environments that observe {OBS_MODE!r}",
        unit=clock.rate_unit,
        variable="task",
        values=(task_id,),
        samples=by_series((task_id,), samples),
        ratios=tuple((VECTOR, name) for name in names),
    )


class DrawingProcesses:
    """Processes, as many as workers, that do nothing but let SAPIEN draw all of a world."""

    def __init__(self, task_id: str, clock: Clock) -> None:
        """Start them."""
        self._clock = clock
        self._workers = [
            Worker[Connection](processes.context.Pipe(), _draw, task_id, clock)
            for _ in range(WORKERS)
        ]

    def __enter__(self) -> DrawingProcesses:
        """Wait until all are ready."""
        try:
            for worker in self._workers:
                _answer(worker)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        for worker in self._workers:
            worker.end()

    def rate(self, number: int) -> float:
        """Return how many pictures they draw per second, together."""
        for worker in self._workers:
            worker.line.send(DRAWN)
        return self._clock.rate((DRAWN, _answer(worker)) for worker in self._workers)


def _draw(connection: Connection, task_id: str, clock: Clock) -> None:
    """Draw as many pictures as is asked for, and answer with the seconds that it took."""
    import tasks

    processes.end_with_parent()
    env = tasks.make(task_id, obs_mode=OBS_MODE)
    env.reset(0)
    connection.send(0.0)
    while True:
        try:
            count = connection.recv()
        except EOFError:
            return
        start = clock.now()
        for _ in range(count):
            # With its markers a world is drawn at once, nothing left out.
            env.simulation.look(0, env.observer.cameras, (OBS_MODE,), markers=True)
        connection.send(clock.now() - start)


def _answer(worker: Worker[Connection]) -> float:
    try:
        return worker.line.recv()
    except (EOFError, OSError):
        raise BenchmarkError(f"a process that only draws {worker.death()}") from None
