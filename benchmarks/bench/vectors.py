"""What vectors cost: their rate beside processes that only do physics, their start and memory."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AsyncVectorEnv
from numpy.typing import NDArray

import tasks
from benchmarks.bench.environments import HERE, NATIVE, PHYSICS, random_actions
from benchmarks.bench.measurement import (
    CORES,
    BenchmarkError,
    Clock,
    Measurement,
    Sample,
    Settings,
    measured,
)
from parity.native import make_native_front
from robot_layouts.simulation.rendering import vulkan_problem
from tasks import get_task_class, list_clones

PROCESSES = 2  # of a vector
VECTOR, ASYNCHRONOUS, DRAWING = "vector", "asynchronous", "SAPIEN's drawing of everything"
FEW, MANY = 4, 36  # environments in a worker whose memory is compared
OBS_MODE = "rgb"
PICTURE_STEPS, PICTURE_ROUNDS, DRAWN = 2, 5, 8  # a picture takes tens of ms of a processor


def vectors(settings: Settings, native: bool = False) -> Measurement:
    """Vectors on two cores, in lockstep and asynchronous, quiet and disturbed."""
    share, batch = settings.worker_envs, PROCESSES * settings.worker_envs // 2
    num_envs, clock, steps = PROCESSES * share, settings.clock, settings.batch_steps
    samples: dict[tuple[str, str], list[float]] = {}
    for task_id in settings.vector_task:
        with ExitStack() as stack:
            lockstep = stack.enter_context(vector(task_id, num_envs, PROCESSES))
            asynchronous = vector(task_id, num_envs, PROCESSES, batch_size=batch)
            timed = TimedVector(lockstep, clock, steps)
            rates: dict[str, Sample] = {
                HERE: timed.rate,
                ASYNCHRONOUS: TimedVector(
                    stack.enter_context(asynchronous), clock, steps
                ).asynchronous_rate,
            }
            # Native's wrapper cannot run tasks of several robots.
            if native and task_id in list_clones() and len(get_task_class(task_id).layout) == 1:
                other = stack.enter_context(closing(_native_vector(task_id, "state")))
                rates[NATIVE] = TimedVector(other, clock, steps).rate
            floor = stack.enter_context(Helpers(PROCESSES, _do_physics, task_id, share))
            rates[PHYSICS] = partial(physics_rate, floor, share, timed)
            busy = stack.enter_context(_busy_core())
            disturbed = f"{task_id}, one core disturbed"
            variants = {(name, task_id): rate for name, rate in rates.items()}
            variants |= {(name, disturbed): partial(busy, rate) for name, rate in rates.items()}
            samples.update(settings.interleave(variants, part=1 / len(settings.vector_task)))
    title = (
        f"Rate of {PROCESSES} × {share} environments; asynchronous: {batch} are received at a time;"
        f" native: AsyncVectorEnv of {PROCESSES}"
    )
    ratios = (*[(HERE, NATIVE)] * native, (HERE, PHYSICS), (ASYNCHRONOUS, PHYSICS))
    return measured("vector", title, clock.rate_unit, "task", samples, (PHYSICS,), ratios)


def workers(settings: Settings) -> Measurement:
    """The rate by number of worker processes."""
    task_id, share = settings.task[0], settings.worker_envs
    samples: dict[tuple[str, int], list[float]] = {}
    with Helpers(max(1, *settings.workers), _do_physics, task_id, share) as floor:
        for count in settings.workers:
            with vector(task_id, max(1, count) * share, count) as env:
                timed = TimedVector(env, settings.clock, settings.batch_steps)
                variants: dict[tuple[str, int], Sample] = {
                    (VECTOR, count): timed.rate,
                    (PHYSICS, count): partial(physics_rate, floor, share, timed),
                }
                samples.update(settings.interleave(variants, part=1 / len(settings.workers)))
    title, unit = f"Rate of {share} environments per worker, {task_id}", settings.clock.rate_unit
    variable, ratios = "workers (0: in this process)", ((VECTOR, PHYSICS),)
    return measured("workers", title, unit, variable, samples, (PHYSICS,), ratios)


def pictures(settings: Settings, native: bool = False) -> Measurement:
    """The rate of environments that observe pictures, beside SAPIEN's drawing alone."""
    if problem := vulkan_problem():
        raise BenchmarkError(f"no pictures can be drawn here: {problem}")
    task_id, clock = settings.task[0], settings.clock
    with ExitStack() as stack:
        own = vector(task_id, PROCESSES * settings.worker_envs, PROCESSES, obs_mode=OBS_MODE)
        made = {VECTOR: (stack.enter_context(own), PICTURE_STEPS)}
        if native:
            other = stack.enter_context(closing(_native_vector(task_id, OBS_MODE)))
            made[NATIVE] = (other, DRAWN)
        variants: dict[tuple[str, str], Sample] = {
            (name, task_id): TimedVector(env, clock, steps).rate
            for name, (env, steps) in made.items()
        }
        floor = stack.enter_context(
            Helpers(PROCESSES, draw_everything, task_id, {"obs_mode": OBS_MODE})
        )
        variants[DRAWING, task_id] = lambda number: clock.rate(
            (DRAWN, seconds) for seconds in floor.ask([(DRAWN, clock)] * PROCESSES)
        )
        samples = settings.interleave(variants, rounds=min(settings.rounds, PICTURE_ROUNDS))
    title = f"Rate of {PROCESSES} × {settings.worker_envs} environments that observe {OBS_MODE!r}"
    ratios = tuple((VECTOR, name) for name, _ in samples if name != VECTOR)
    return measured("pictures", title, clock.rate_unit, "task", samples, ratios=ratios)


def start(settings: Settings) -> Measurement:
    """The start of a vector on all cores, up to its first observation."""
    task_id, clock = settings.task[0], settings.clock

    def seconds(count: int, number: int) -> float:
        begun = clock.now()
        with vector(task_id, count, min(count, CORES)) as env:
            env.reset(seed=number)
            return clock.now(_worker_ids()) - begun

    variants = {("start", count): partial(seconds, count) for count in settings.started}
    samples = settings.interleave(variants, rounds=min(settings.rounds, 2), warm_up=False)
    title, unit = f"Start of a vector on {CORES} cores, {task_id}", "s until the first observation"
    return measured("start", title, unit, "environments", samples)


def memory(settings: Settings) -> Measurement:
    """The memory of one more environment in a worker."""

    def extra(task_id: str, number: int) -> float:
        few, many = (_private_memory(task_id, count) for count in (FEW, MANY))
        return (many - few) / (MANY - FEW)

    variants = {("one more environment", name): partial(extra, name) for name in settings.task}
    samples = settings.interleave(variants, rounds=1, warm_up=False)
    title = f"Memory of a worker, from {FEW} to {MANY} environments"
    return measured("memory", title, "MB per environment", "task", samples)


class TimedVector:
    """A vector of environments, under random actions."""

    def __init__(self, env: Any, clock: Clock, steps: int) -> None:
        """Take a vector whose episodes are no shorter than ``steps``."""
        self.num_envs: int = env.num_envs
        self.steps, self.clock, self._env = steps, clock, env
        self._others = _worker_ids()

    def rate(self, number: int) -> float:
        """Return how many environment steps it does per second."""
        actions = self.actions(number)
        self._env.reset(seed=number)
        start = self.clock.now(self._others)
        for action in actions:
            self._env.step(action)
        return self.num_envs * self.steps / (self.clock.now(self._others) - start)

    def asynchronous_rate(self, number: int) -> float:
        """Return the same, if it is sent actions and received from, whichever is ready.

        As many are under way at the end as at the beginning.
        """
        actions, size = self.actions(number), self._env.batch_size
        steps = np.zeros(self.num_envs, np.intp)
        self._env.reset(seed=number)
        self._env.send(actions[0], np.arange(self.num_envs))

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

    def actions(self, number: int) -> NDArray[np.float32]:
        """Return the actions of a round, shape (steps, N, A)."""
        width = self._env.single_action_space.shape[0]
        return random_actions(number, self.steps, self.num_envs, width)


class Helpers:
    """Processes that all do the same kind of work and answer with the seconds that it took."""

    def __init__(self, count: int, work: Callable[..., None], *arguments: Any) -> None:
        """Start them.

        Args:
            count: How many.
            work: What each runs, with its end of a pipe: first it sends that it is ready.
            arguments: What ``work`` takes besides.
        """
        context, self._pipes, self._processes = multiprocessing.get_context("spawn"), [], []
        for _ in range(count):
            ours, theirs = context.Pipe()
            process = context.Process(target=work, args=(theirs, *arguments), daemon=True)
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def __enter__(self) -> Helpers:
        """Wait until all are ready."""
        for number in range(len(self._pipes)):
            self._answer(number)
        return self

    def __exit__(self, *_: object) -> None:
        """End them."""
        for process in self._processes:
            process.kill()
            process.join()

    @property
    def pids(self) -> list[int]:
        """Their ids."""
        return [process.pid or 0 for process in self._processes]

    def ask(self, work: Iterable[object]) -> list[float]:
        """Give work to the first processes, and return the seconds that each took for it."""
        numbers = [self._send(number, part) for number, part in enumerate(work)]
        return [self._answer(number) for number in numbers]

    def _send(self, number: int, part: object) -> int:
        self._pipes[number].send(part)
        return number

    def _answer(self, number: int) -> float:
        try:
            return self._pipes[number].recv()
        except (EOFError, OSError) as error:
            self._processes[number].join(2.0)
            code = self._processes[number].exitcode
            raise BenchmarkError(f"a process of a benchmark ended with {code}") from error


def physics_rate(floor: Helpers, share: int, timed: TimedVector, number: int) -> float:
    """Return how many environment steps' physics processes do per second, together.

    Args:
        floor: The processes, which run `_do_physics`.
        share: Environments of each.
        timed: The vector whose motion they repeat.
        number: The number of the round.
    """
    parts = np.split(timed.actions(number), timed.num_envs // share, axis=1)
    work = [(part, number + i * share, timed.clock) for i, part in enumerate(parts)]
    return timed.clock.rate((timed.steps * share, seconds) for seconds in floor.ask(work))


def _do_physics(pipe: Any, task_id: str, num_envs: int) -> None:
    torch.set_num_threads(1)
    env = tasks.make(task_id, num_envs=num_envs)
    pipe.send(0.0)
    while True:
        actions, seed, clock = pipe.recv()
        env.reset(seed)
        pipe.send(sum(env.simulation.timed_step(action, clock.now) for action in actions))


def draw_everything(pipe: Any, task_id: str, making: Mapping[str, Any]) -> None:
    """Draw a world in a process of `Helpers`, as often as asked."""
    env = tasks.make(task_id, **making)
    env.reset(0)
    pipe.send(0.0)
    while True:
        count, clock = pipe.recv()
        start = clock.now()
        for _ in range(count):
            # With its markers a world is drawn at once, nothing left out.
            env.simulation.look(0, env.observer.cameras, (OBS_MODE,), markers=True)
        pipe.send(clock.now() - start)


def _count_for_ever(pipe: Any) -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    pipe.send(0.0)
    while True:
        np.zeros(1000).sum()


@contextmanager
def _busy_core() -> Generator[Callable[[Sample, int], float]]:
    """Give what takes a sample while one of this process's cores is busy."""
    with Helpers(1, _count_for_ever) as helper:
        (pid,) = helper.pids
        os.kill(pid, signal.SIGSTOP)

        def disturbed(sample: Sample, number: int) -> float:
            os.kill(pid, signal.SIGCONT)
            try:
                return sample(number)
            finally:
                os.kill(pid, signal.SIGSTOP)

        yield disturbed


@contextmanager
def vector(task_id: str, num_envs: int, num_workers: int, **making: Any) -> Generator[Any]:
    """Give a vector of environments."""
    name = f"RobotLayouts/{get_task_class(task_id).task_id}"
    env = gymnasium.make_vec(name, num_envs=num_envs, num_workers=num_workers, **making)
    with closing(env):
        yield env


def _native_vector(task_id: str, obs_mode: str) -> AsyncVectorEnv:
    make = [partial(make_native_front, task_id, obs_mode)] * PROCESSES
    return AsyncVectorEnv(make, context="spawn")


def _worker_ids() -> list[int]:
    """Return the ids of the processes that this one has started."""
    return [child.pid for child in multiprocessing.active_children() if child.pid is not None]


def _private_memory(task_id: str, num_envs: int) -> float:
    """Return the memory that a worker with some environments shares with no one (MB)."""
    before = set(_worker_ids())
    with vector(task_id, num_envs, 1) as env:
        env.reset(seed=0)
        for action in random_actions(0, 5, num_envs, env.single_action_space.shape[0]):
            env.step(action)
        (worker,) = set(_worker_ids()) - before
        try:
            lines = Path(f"/proc/{worker}/smaps_rollup").read_text().splitlines()
        except OSError as error:
            raise BenchmarkError(f"Linux tells no memory of processes here: {error}") from error
    private = [line.split()[1] for line in lines if line.startswith("Private_")]
    return sum(map(int, private)) * 1024 / 1e6
