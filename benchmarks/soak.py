"""``python -m benchmarks soak``: every task is stepped for long, and nothing held may grow.

Each lap goes through all tasks. A task's vectors are made without workers, played and closed, round
after round of the same work, and the level of this process is read after each. In one of the laps
the task is also played in worker processes, and the level of each worker is read after each round.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from itertools import combinations
from pathlib import Path

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from rich import box
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from robots import TaskError
from tasks import get_task_class, list_tasks
from tasks.interfaces.vector import VectorTask

WORKER_ROUNDS, OWN_ROUNDS = 15, 6  # in workers; in this process, in each lap
WARM_UP = 3  # rebuilds of all environments in workers, until the heap has its holes
OWN_SHARE = 0.1  # of all steps, without workers
OWN_ENVS = 4  # at most
REBUILT = 1 / 16  # of the environments, in each round
OWN_LIMIT = 1.0  # MB that this process may grow within the rounds, or from lap to lap
# MB that a worker may. Worlds that come and go in turn leave holes in the C library's heap: in a
# process with 16 environments it took 10 MB more over some 1,500 rebuilds, and none from there on.
WORKER_LIMIT = 2.5
COUNT_LIMIT = 0.5  # of what is counted
SHARED = ("/memfd:", "/dev/shm/")  # where shared memory shows in a list of mappings


@dataclass(frozen=True)
class Level:
    """What one process holds at a moment.

    Attributes:
        memory: Its own memory, without files and without what it shares (MB).
        descriptors: Open file descriptors.
        threads: Threads.
        processes: Processes that it started and that have not been waited for.
        shared: Pieces of shared memory, mapped or open.
    """

    memory: float
    descriptors: float
    threads: float
    processes: float
    shared: float


QUANTITIES = tuple(field.name for field in fields(Level))


@dataclass(frozen=True)
class Soak:
    """What to do.

    Attributes:
        steps: Environment steps of everything together; a few more are taken.
        tasks: The tasks.
        num_envs: Environments of a vector with workers.
        workers: Its workers.
        laps: How often to go through all tasks, three times or more; the first warms up.
    """

    steps: int
    tasks: tuple[str, ...]
    num_envs: int
    workers: int
    laps: int

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            TaskError: If one is invalid.
        """
        for name, least in (("steps", 1), ("num_envs", 1), ("workers", 1), ("laps", 3)):
            if (value := getattr(self, name)) < least:
                raise TaskError(f"{name} is {value}; it must be {least} or more")
        if self.workers > self.num_envs:
            raise TaskError(f"{self.workers} workers cannot share {self.num_envs} environments")

    @property
    def own_envs(self) -> int:
        """Environments of a vector without workers."""
        return min(OWN_ENVS, self.num_envs)

    @property
    def worker_steps(self) -> int:
        """Steps of a vector in each round in workers."""
        envs = self.num_envs * WORKER_ROUNDS * len(self.tasks)
        return max(1, round(self.steps * (1 - OWN_SHARE) / envs))

    @property
    def own_steps(self) -> int:
        """Steps of a vector in each round without workers."""
        envs = self.own_envs * OWN_ROUNDS * self.laps * len(self.tasks)
        return max(1, round(self.steps * OWN_SHARE / envs))


@dataclass
class Soaked:
    """What was seen of a task.

    Attributes:
        task_id: The task.
        steps: Environment steps taken.
        seconds: How long they took, making and closing the vectors included.
        workers: Levels of each worker after each round.
        rounds: Levels of this process after each round without workers, lap by lap.
        after: Level of this process after each lap of this task.
    """

    task_id: str
    steps: int = 0
    seconds: float = 0.0
    workers: list[list[Level]] = field(default_factory=list[list[Level]])
    rounds: list[list[Level]] = field(default_factory=list[list[Level]])
    after: list[Level] = field(default_factory=list[Level])

    @property
    def in_workers(self) -> Level:
        """By how much the worker grows that grows most."""
        return worst(grown([levels]) for levels in self.workers)

    @property
    def in_process(self) -> Level:
        """By how much this process grows while vectors without workers come and go."""
        return grown(self.rounds)


def soak(
    *,
    steps: int = 2_000_000,
    tasks: tuple[str, ...] = (),
    envs: int = 32,
    workers: int = 2,
    laps: int = 3,
) -> int:
    """Step every task for a long time, and check that memory and processes do not grow.

    Growth is what the rounds of equal work after the first third add: in the worst of the workers,
    and in this process while it makes and closes vectors. Exit code: 1 if something grows.

    Args:
        steps: Environment steps.
        tasks: Task ids (all).
        envs: Environments of a vector.
        workers: Number of processes.
        laps: How many times all tasks are stepped.

    Raises:
        RobotLayoutsError: If an argument is invalid, or a worker is lost.
    """
    names = tuple(get_task_class(name).task_id for name in tasks or list_tasks())
    found = run(Soak(steps, names, envs, workers, laps))
    rest, growing = between_laps(found), complaints(found)
    rows = Table(box=box.SIMPLE_HEAD)
    for name in (
        "task",
        "steps",
        "steps/s",
        "worker\nMB",
        "growth\nMB",
        "here\ngrowth",
        "all else",
    ):
        rows.add_column(name)
    for task in found:
        worker, here = task.in_workers, task.in_process
        rows.add_row(
            task.task_id,
            f"{task.steps:,}",
            f"{task.steps / task.seconds:,.0f}",
            f"{max(levels[-1].memory for levels in task.workers):.0f}",
            f"{worker.memory:+.2f}",
            f"{here.memory:+.2f}",
            _counted(worst((worker, here))),
        )
    Console(highlight=False).print(rows)
    print(f"This process, from lap to lap: {rest.memory:+.2f} MB, all else {_counted(rest)}.")
    for complaint in growing:
        print(f"GROWS: {complaint}")
    total, seconds = sum(task.steps for task in found), sum(task.seconds for task in found)
    verdict = "something" if growing else "nothing"
    print(f"{total:,} environment steps in {seconds:.0f} s: {verdict} grows.")
    return 1 if growing else 0


def _counted(level: Level) -> str:
    growth = {name: getattr(level, name) for name in QUANTITIES[1:]}
    return ", ".join(f"{name} {value:+.1f}" for name, value in growth.items() if value) or "–"


def run(wanted: Soak) -> list[Soaked]:
    """Carry out a soak.

    Raises:
        RobotLayoutsError: If a task cannot be made, or a worker is lost.
    """
    torch.set_num_threads(1)
    gc.collect()
    gc.freeze()  # what is there already is not looked through before every level
    found, rng = [Soaked(name) for name in wanted.tasks], np.random.default_rng(0)
    modes = list(AutoresetMode)
    try:
        with tqdm(total=wanted.steps, unit="steps", disable=None) as bar:
            for lap in range(wanted.laps):
                for number, task in enumerate(found):
                    bar.set_description(task.task_id)
                    started, mode = time.monotonic(), modes[(lap + number) % len(modes)]
                    if lap == number % wanted.laps:
                        _play_in_workers(wanted, task, mode, rng, bar.update)
                    _play_in_process(wanted, task, mode, rng, bar.update)
                    task.after.append(_own_level())
                    task.seconds += time.monotonic() - started
    finally:
        gc.unfreeze()
    return found


Advance = Callable[[int], object]


def _play_in_workers(
    wanted: Soak, task: Soaked, mode: AutoresetMode, rng: np.random.Generator, advance: Advance
) -> None:
    """Play rounds in one vector with workers, and read their levels."""
    env = VectorTask(task.task_id, wanted.num_envs, num_workers=wanted.workers, autoreset_mode=mode)
    try:
        pids = [process.pid for process in multiprocessing.active_children()]
        task.workers = [[] for _ in pids]
        for _ in range(WARM_UP):
            env.reset(options={"reconfigure": True})
        for _ in range(WORKER_ROUNDS):
            _round(env, task, wanted.worker_steps, rng, advance)
            for levels, pid in zip(task.workers, pids, strict=True):
                levels.append(read_level(pid))
    finally:
        env.close()


def _play_in_process(
    wanted: Soak, task: Soaked, mode: AutoresetMode, rng: np.random.Generator, advance: Advance
) -> None:
    """Play rounds, each in a vector of its own in this process, and read its level."""
    levels: list[Level] = []
    for _ in range(OWN_ROUNDS):
        env = VectorTask(task.task_id, wanted.own_envs, num_workers=0, autoreset_mode=mode)
        try:
            _round(env, task, wanted.own_steps, rng, advance)
        finally:
            env.close()
        del env
        levels.append(_own_level())
    task.rounds.append(levels)


def _round(
    env: VectorTask, task: Soaked, steps: int, rng: np.random.Generator, advance: Advance
) -> None:
    """Begin episodes, step, rebuild some environments half-way, and step on."""
    env.reset(seed=int(rng.integers(2**31)))
    width = max(part.stop for part in env.action_split.values())
    for number in range(steps):
        if number == steps // 2:
            mask = rng.permutation(np.arange(env.num_envs) < max(1, REBUILT * env.num_envs))
            env.reset(options={"reset_mask": mask, "reconfigure": True})
        env.step(rng.uniform(-1, 1, (env.num_envs, width)).astype(np.float32))
        task.steps += env.num_envs
        advance(env.num_envs)


def between_laps(found: Sequence[Soaked]) -> Level:
    """Return by how much this process grows from lap to lap, the first one left out.

    Each task is compared with itself; the median task counts, so that one lap in which Python or
    the C library happened to keep a piece of memory says nothing.
    """

    def per_lap(task: Soaked, name: str) -> float:
        _, *settled = (getattr(level, name) for level in task.after)
        return (settled[-1] - settled[0]) / (len(settled) - 1)

    return Level(*(float(np.median([per_lap(t, name) for t in found])) for name in QUANTITIES))


def complaints(found: Sequence[Soaked]) -> list[str]:
    """Return what grows by more than chance, and where, one line each."""
    seen = [
        place
        for task in found
        for place in (
            (f"{task.task_id}: {{}} in workers", task.in_workers, WORKER_LIMIT),
            (f"{task.task_id}: {{}} in this process", task.in_process, OWN_LIMIT),
        )
    ]
    seen.append(("{} of this process, from lap to lap", between_laps(found), OWN_LIMIT))
    return [
        where.format(name)
        for where, level, memory in seen
        for name in QUANTITIES
        if getattr(level, name) > (memory if name == "memory" else COUNT_LIMIT)
    ]


def growth(series: Sequence[Sequence[float]]) -> float:
    """Return by how much values grow while equal work is done again and again.

    The slope that three quarters of all pairs of values exceed, times the length: a single step up,
    or values that rise and fall, count for nothing. The first third of each series is warming up.

    Args:
        series: Values after each round of work, one or more series of them, each of the same
            length.
    """
    settled = [values[len(values) // 3 :] for values in series]
    slopes = [
        (values[j] - values[i]) / (j - i)
        for values in settled
        for i, j in combinations(range(len(values)), 2)
    ]
    return float(np.quantile(slopes, 0.25)) * (len(settled[0]) - 1) if slopes else 0.0


def grown(series: Sequence[Sequence[Level]]) -> Level:
    """Return the `growth` of every quantity."""

    def values(name: str) -> list[list[float]]:
        return [[getattr(level, name) for level in levels] for levels in series]

    return Level(*(growth(values(name)) for name in QUANTITIES))


def worst(levels: Iterable[Level]) -> Level:
    """Return the largest value of each quantity."""
    found = list(levels)
    return Level(*(max(getattr(level, name) for level in found) for name in QUANTITIES))


def _own_level() -> Level:
    gc.collect()
    return read_level()


def read_level(pid: int | None = None) -> Level:
    """Return what a process holds, from Linux's ``/proc``.

    Args:
        pid: The process; None is this one.

    Raises:
        OSError: If it is gone, or is another user's.
    """
    folder = Path("/proc") / ("self" if pid is None else str(pid))
    targets: list[str] = []
    for link in (folder / "fd").iterdir():
        try:
            targets.append(os.readlink(link))
        except FileNotFoundError:  # closed since it was listed
            continue
    mapped = [line.split(maxsplit=5)[-1] for line in (folder / "maps").read_text().splitlines()]
    threads = list((folder / "task").iterdir())
    sizes = dict(
        line.split()[:2] for line in (folder / "smaps_rollup").read_text().splitlines()[1:]
    )
    return Level(
        memory=int(sizes["Anonymous:"]) / 1024,
        descriptors=sum(not target.startswith("/proc/") for target in targets),  # not our own
        threads=len(threads),
        processes=sum(len((thread / "children").read_text().split()) for thread in threads),
        shared=sum(name.startswith(SHARED) for name in (*targets, *mapped)),
    )
