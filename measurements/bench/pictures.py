"""What observing with cameras costs: vectors that draw, beside SAPIEN's drawing alone."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

from measurements.bench.measurement import BenchmarkError, Measurement, by_series
from measurements.bench.processes import VECTOR, TimedVector, vector
from measurements.bench.settings import Clock, Settings
from simulation.rendering.pictures import vulkan_problem
from tasks.processes.transport import packed
from tasks.processes.worker import Pool

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
        self._clock, self._pool = clock, Pool()
        work = packed(partial(_drawing, task_id, clock))
        self._workers = [self._pool.spawn(work) for _ in range(WORKERS)]

    def __enter__(self) -> DrawingProcesses:
        """Wait until all are ready."""
        try:
            self._pool.results(self._workers)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        self._pool.shutdown()

    def rate(self, number: int) -> float:
        """Return how many pictures they draw per second, together."""
        for worker in self._workers:
            worker.request(DRAWN)
        return self._clock.rate((DRAWN, one) for one in self._pool.results(self._workers))


def _drawing(task_id: str, clock: Clock) -> Callable[[int], float]:
    """Return what draws so many pictures, and returns the seconds that it took."""
    import tasks

    env = tasks.make(task_id, obs_mode=OBS_MODE)
    env.reset(0)

    def draw(count: int) -> float:
        start = clock.now()
        for _ in range(count):
            # With its markers a world is drawn at once, nothing left out.
            env.simulation.look(0, env.observer.cameras, (OBS_MODE,), markers=True)
        return clock.now() - start

    return draw
