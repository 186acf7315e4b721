"""What worker processes cost: their rate beside physics-only ones, their start, their memory."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from measurements.bench.measurement import BenchmarkError, Measurement, by_series
from measurements.bench.settings import CORES, Clock, Settings
from measurements.bench.steps import PHYSICS, random_actions
from tasks import get_task_class
from tasks.processes.transport import packed
from tasks.processes.worker import Pool

VECTOR = "vector"
FEW, MANY = 4, 36  # environments in a worker whose memory is compared


def workers(settings: Settings) -> Measurement:
    """Measure the rate of vectors with some numbers of workers."""
    task_id, share = settings.tasks[0], settings.worker_envs
    samples: dict[tuple[str, int], list[float]] = {}
    making = settings.making
    with PhysicsProcesses(task_id, max(1, *settings.workers), share, making) as floor:
        for count in settings.workers:
            with vector(task_id, max(1, count) * share, count, **making) as env:
                timed = TimedVector(env, settings.clock, settings.batch_steps)
                variants = {
                    (VECTOR, count): timed.rate,
                    (PHYSICS, count): lambda number, timed=timed: floor.rate(timed, number),
                }
                part = 1 / len(settings.workers)
                samples.update(settings.interleave(variants, part=part))
    return Measurement(
        name="workers",
        title=f"Rate of {share} environments per worker, {task_id}",
        unit=settings.clock.rate_unit,
        variable="workers (0: in this process)",
        values=settings.workers,
        samples=by_series(settings.workers, samples),
        floors=(PHYSICS,),
        ratios=((VECTOR, PHYSICS),),
    )


def start(settings: Settings) -> Measurement:
    """Time the start of a vector on all cores, up to its first observation."""
    task_id = settings.tasks[0]

    def seconds(count: int) -> Callable[[int], float]:
        def sample(number: int) -> float:
            begun = settings.clock.now()
            with vector(task_id, count, min(count, CORES), **settings.making) as env:
                env.reset(seed=number)
                return settings.clock.now(worker_ids()) - begun

        return sample

    variants = {("start", count): seconds(count) for count in settings.started}
    samples = settings.interleave(variants, rounds=min(settings.rounds, 2), warm_up=False)
    return Measurement(
        name="start",
        title=f"Start of a vector on {CORES} cores, {task_id}",
        unit="s until the first observation",
        variable="environments",
        values=settings.started,
        samples=by_series(settings.started, samples),
    )


def memory(settings: Settings) -> Measurement:
    """Measure how much memory one more environment takes in a worker."""
    variants = {
        ("one more environment", task_id): lambda number, task_id=task_id: _extra(task_id, settings)
        for task_id in settings.tasks
    }
    return Measurement(
        name="memory",
        title=f"Memory of a worker, from {FEW} to {MANY} environments",
        unit="MB per environment",
        variable="task",
        values=settings.tasks,
        samples=by_series(settings.tasks, settings.interleave(variants, rounds=1, warm_up=False)),
    )


class TimedVector:
    """A vector of environments, under random actions."""

    def __init__(self, env: Any, clock: Clock, steps: int) -> None:
        """Take a vector whose episodes are no shorter than ``steps``."""
        self.num_envs: int = env.num_envs
        self.steps, self.clock, self._env = steps, clock, env
        self._others = worker_ids()

    def rate(self, number: int) -> float:
        """Return how many environment steps it does per second."""
        actions = self.actions(number)
        self._env.reset(seed=number)
        start = self.clock.now(self._others)
        for action in actions:
            self._env.step(action)
        return self.num_envs * self.steps / (self.clock.now(self._others) - start)

    def actions(self, number: int) -> NDArray[np.float32]:
        """Return the actions of a round, shape (steps, N, A)."""
        numbers = self._env.single_action_space.shape[0]
        return random_actions(number, self.steps, self.num_envs, numbers)


class TimedAsynchronously(TimedVector):
    """A vector that is sent actions and received from, whoever is ready."""

    def rate(self, number: int) -> float:
        """Return how many environment steps it does per second, once it runs.

        As many are under way at the end as at the beginning.
        """
        actions, size = self.actions(number), self._env.batch_size
        everyone = np.arange(self.num_envs)
        steps = np.zeros(self.num_envs, np.intp)
        self._env.reset(seed=number)
        self._env.send(actions[0], everyone)

        def turn() -> None:
            ids = self._env.recv()[4]["env_id"]
            steps[ids] += 1
            self._env.send(actions[steps[ids] % self.steps, ids], ids)

        turn()
        count = self.steps * self.num_envs // size
        start = self.clock.now(self._others)
        for _ in range(count):
            turn()
        seconds = self.clock.now(self._others) - start
        self._env.reset(seed=number)
        return count * size / seconds


class PhysicsProcesses:
    """Processes that all do nothing but physics: what any vector is measured against."""

    def __init__(
        self, task_id: str, count: int, num_envs: int, making: Mapping[str, Any] | None = None
    ) -> None:
        """Start ``count`` processes, with ``num_envs`` environments each."""
        self._num_envs, self._pool = num_envs, Pool()
        work = packed(partial(_physics, task_id, num_envs, dict(making or {})))
        self._workers = [self._pool.spawn(work) for _ in range(count)]

    def __enter__(self) -> PhysicsProcesses:
        """Wait until all are ready."""
        try:
            self._pool.results(self._workers)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        self.close()

    def rate(self, timed: TimedVector, number: int) -> float:
        """Return how many environment steps' physics they do per second, together.

        Args:
            timed: The vector whose motion they repeat.
            number: The number of the round.
        """
        size = self._num_envs
        used = self._workers[: timed.num_envs // size]
        actions = timed.actions(number)
        for i, worker in enumerate(used):
            own = actions[:, i * size : (i + 1) * size]
            worker.request(own, number + i * size, timed.clock)
        seconds = self._pool.results(used)
        return timed.clock.rate((timed.steps * size, one) for one in seconds)

    def close(self) -> None:
        """End them."""
        self._pool.shutdown()


def _physics(task_id: str, num_envs: int, making: Mapping[str, Any]) -> Callable[..., float]:
    """Return what does the physics of actions, and returns the seconds that it took."""
    import torch

    import tasks

    torch.set_num_threads(1)
    env = tasks.make(task_id, num_envs=num_envs, **making)

    def work(actions: NDArray[np.float32], seed: int, clock: Clock) -> float:
        env.reset(seed)
        return sum(env.simulation.timed_step(action, clock.now) for action in actions)

    return work


@contextmanager
def vector(task_id: str, num_envs: int, num_workers: int, **making: Any) -> Generator[Any]:
    """Give a vector of a task, and close it in the end."""
    name = f"RobotLayouts/{get_task_class(task_id).task_id}"
    env = gymnasium.make_vec(name, num_envs=num_envs, num_workers=num_workers, **making)
    with closing(env):
        yield env


def worker_ids() -> Sequence[int]:
    """Return the ids of the processes that this one has started."""
    return [child.pid for child in multiprocessing.active_children() if child.pid is not None]


def _extra(task_id: str, settings: Settings) -> float:
    """Return the memory of one more environment (MB)."""
    few, many = (_private_memory(task_id, count, settings) for count in (FEW, MANY))
    return (many - few) / (MANY - FEW)


def _private_memory(task_id: str, num_envs: int, settings: Settings) -> float:
    """Return the memory that a worker with some environments shares with no one (MB)."""
    before = set(worker_ids())
    with vector(task_id, num_envs, 1, **settings.making) as env:
        env.reset(seed=0)
        for action in random_actions(0, 5, num_envs, env.single_action_space.shape[0]):
            env.step(action)
        (worker,) = set(worker_ids()) - before
        return _private(worker)


def _private(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError as error:
        raise BenchmarkError(f"Linux tells no memory of processes here: {error}") from error
    own = [line.split()[1] for line in lines if line.startswith(("Private_Clean", "Private_Dirty"))]
    return sum(map(int, own)) * 1024 / 1e6
