"""A soak: every task is stepped for long, and nothing that its processes hold may grow.

Each lap goes through all tasks. A task's vectors are made without workers, played and closed, round
after round of the same work, and the level of this process is read after each. In one of the laps
the task is also played in worker processes, and the level of each worker is read after each round.
"""

from __future__ import annotations

import gc
import multiprocessing
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from measurements.soak.process_resources import QUANTITIES, Level, grown, read_level, worst
from robots import TaskError
from tasks import get_task_class, list_tasks
from tasks.fronts.vector import VectorTask

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

Progressed = Callable[[str, int], None]


@dataclass(frozen=True)
class Soak:
    """What to do.

    Attributes:
        steps: Environment steps of everything together; a few more are taken.
        task_ids: The tasks.
        num_envs: Environments of a vector with workers.
        num_workers: Its workers.
        laps: How often to go through all tasks, three times or more; the first warms up.
        seed: Of the actions, and of which environments are reset.

    Raises:
        TaskError: If a number makes no sense.
    """

    steps: int
    task_ids: tuple[str, ...] = field(default_factory=lambda: tuple(list_tasks()))
    num_envs: int = 32
    num_workers: int = 2
    laps: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, least in (("steps", 1), ("num_envs", 1), ("num_workers", 1), ("laps", 3)):
            if (value := getattr(self, name)) < least:
                raise TaskError(f"{name} is {value}; it must be {least} or more")
        if self.num_workers > self.num_envs:
            raise TaskError(f"{self.num_workers} workers cannot share {self.num_envs} environments")

    @property
    def own_envs(self) -> int:
        """Environments of a vector without workers."""
        return min(OWN_ENVS, self.num_envs)

    @property
    def worker_steps(self) -> int:
        """Steps of a vector in each round in workers."""
        envs = self.num_envs * WORKER_ROUNDS * len(self.task_ids)
        return max(1, round(self.steps * (1 - OWN_SHARE) / envs))

    @property
    def own_steps(self) -> int:
        """Steps of a vector in each round without workers."""
        envs = self.own_envs * OWN_ROUNDS * self.laps * len(self.task_ids)
        return max(1, round(self.steps * OWN_SHARE / envs))

    @property
    def planned(self) -> int:
        """Environment steps of everything together, exactly."""
        in_workers = self.worker_steps * self.num_envs * WORKER_ROUNDS
        here = self.own_steps * self.own_envs * OWN_ROUNDS * self.laps
        return (in_workers + here) * len(self.task_ids)


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


def soak(wanted: Soak, progressed: Progressed = lambda task_id, steps: None) -> list[Soaked]:
    """Carry out a soak.

    Args:
        wanted: What to do.
        progressed: Called with a task's id and the environment steps taken since the last call.

    Raises:
        RobotLayoutsError: If a task cannot be made, or a worker is lost.
    """
    torch.set_num_threads(1)
    gc.collect()
    gc.freeze()  # what is there already is not looked through before every level
    try:
        return _laps(wanted, progressed)
    finally:
        gc.unfreeze()


def between_laps(found: Sequence[Soaked]) -> Level:
    """Return by how much this process grows from lap to lap, the first one left out.

    Each task is compared with itself; the median task counts, so that one lap in which Python or
    the C library happened to keep a piece of memory says nothing.
    """
    return Level(
        *(
            float(np.median([_per_lap([getattr(x, name) for x in task.after]) for task in found]))
            for name in QUANTITIES
        )
    )


def leaks(level: Level, memory_limit: float) -> list[str]:
    """Return the quantities of a growth that are more than chance; the limit is in MB."""
    limits = {name: memory_limit if name == "memory" else COUNT_LIMIT for name in QUANTITIES}
    return [name for name, limit in limits.items() if getattr(level, name) > limit]


def complaints(found: Sequence[Soaked]) -> list[str]:
    """Return what grows, and where, one line each."""
    lines: list[str] = []
    for task in found:
        for where, level, limit in (
            ("workers", task.in_workers, WORKER_LIMIT),
            ("this process", task.in_process, OWN_LIMIT),
        ):
            lines.extend(f"{task.task_id}: {name} in {where}" for name in leaks(level, limit))
    rest = leaks(between_laps(found), OWN_LIMIT)
    return [*lines, *(f"{name} of this process, from lap to lap" for name in rest)]


def _laps(wanted: Soak, progressed: Progressed) -> list[Soaked]:
    found = [Soaked(get_task_class(name).task_id) for name in wanted.task_ids]
    rng = np.random.default_rng(wanted.seed)
    modes = list(AutoresetMode)
    for lap in range(wanted.laps):
        for number, task in enumerate(found):
            started = time.monotonic()
            player = _Player(wanted, task, rng, modes[(lap + number) % len(modes)], progressed)
            if lap == number % wanted.laps:
                player.play_in_workers()
            player.play_in_process()
            task.after.append(_own_level())
            task.seconds += time.monotonic() - started
    return found


class _Player:
    """Plays one task for one lap."""

    def __init__(
        self,
        wanted: Soak,
        task: Soaked,
        rng: np.random.Generator,
        mode: AutoresetMode,
        progressed: Progressed,
    ) -> None:
        self._wanted, self._task, self._rng = wanted, task, rng
        self._mode, self._progressed = mode, progressed

    def play_in_workers(self) -> None:
        """Play rounds in one vector with workers, and read their levels."""
        env = self._make(self._wanted.num_envs, self._wanted.num_workers)
        try:
            pids = [process.pid for process in multiprocessing.active_children()]
            self._task.workers = [[] for _ in pids]
            for _ in range(WARM_UP):
                env.reset(options={"reconfigure": True})
            for _ in range(WORKER_ROUNDS):
                self._round(env, self._wanted.worker_steps)
                for levels, pid in zip(self._task.workers, pids, strict=True):
                    levels.append(read_level(pid))
        finally:
            env.close()

    def play_in_process(self) -> None:
        """Play rounds, each in a vector of its own in this process, and read its level."""
        levels: list[Level] = []
        for _ in range(OWN_ROUNDS):
            env = self._make(self._wanted.own_envs, 0)
            try:
                self._round(env, self._wanted.own_steps)
            finally:
                env.close()
            del env
            levels.append(_own_level())
        self._task.rounds.append(levels)

    def _make(self, num_envs: int, num_workers: int) -> VectorTask:
        return VectorTask(
            self._task.task_id, num_envs, num_workers=num_workers, autoreset_mode=self._mode
        )

    def _round(self, env: VectorTask, steps: int) -> None:
        """Begin episodes, step, rebuild some environments half-way, and step on."""
        env.reset(seed=int(self._rng.integers(2**31)))
        for number in range(steps):
            if number == steps // 2:
                env.reset(options={"reset_mask": self._some(env.num_envs), "reconfigure": True})
            env.step(self._actions(env))
            self._task.steps += env.num_envs
            self._progressed(self._task.task_id, env.num_envs)

    def _actions(self, env: VectorTask) -> NDArray[np.float32]:
        width = max(part.stop for part in env.action_split.values())
        return self._rng.uniform(-1, 1, (env.num_envs, width)).astype(np.float32)

    def _some(self, num_envs: int) -> NDArray[np.bool_]:
        mask = np.arange(num_envs) < max(1, REBUILT * num_envs)
        return self._rng.permutation(mask)


def _own_level() -> Level:
    gc.collect()
    return read_level()


def _per_lap(values: Sequence[float]) -> float:
    _, *settled = values
    return (settled[-1] - settled[0]) / (len(settled) - 1)
