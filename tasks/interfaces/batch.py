"""Some environments of a vector in one process: automatic resets, results written to arrays."""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from robots import TaskError
from tasks.arrays import leaves
from tasks.engine.checks import RECONFIGURE, SEED
from tasks.engine.env import MultiRobotTask
from tasks.engine.observation import observed_dtype
from tasks.engine.scenario import Scenario
from tasks.interfaces.gymnasium import as_array

Arrays = dict[str, NDArray[Any]]
Shapes = Mapping[str, tuple[tuple[int, ...], str]]
"""Name → shape of one environment's entry, and dtype."""

OBSERVATION, INFO = "obs", "info"  # what the names of their arrays begin with
SEEDS = f"{INFO}/{SEED}"  # which only a reset changes
FINAL = "final_"  # and those of episodes that ended in a step and began anew in it

_ALIGNMENT = 64  # bytes; two arrays never share a cache line


@dataclass(frozen=True)
class BatchPart:
    """Which part of a vector a batch is, and how to make it; can be pickled.

    Attributes:
        task: The task's class.
        scenario: The scenario of the whole vector.
        start: Its first environment's number in the vector.
        stop: One more than its last environment's number.
        autoreset: When an environment whose episode ended begins a new one.
        ignore_terminations: Whether episodes go on after success, until they are truncated.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    start: int
    stop: int
    autoreset: AutoresetMode
    ignore_terminations: bool = False

    @property
    def env_ids(self) -> range:
        """The numbers of its environments in the vector."""
        return range(self.start, self.stop)


class Batch:
    """Environments of one process; each call leaves what it found in their rows of arrays."""

    def __init__(self, part: BatchPart) -> None:
        """Make the task, with the first seeds that it has in one large batch.

        Raises:
            TaskError: If the task cannot be made like that.
            AssetError: If robot files cannot be found.
        """
        scenario = replace(part.scenario, num_envs=len(part.env_ids))
        self._task = part.task(scenario, first_seed=part.task.first_seed + part.start)
        self._step, self._part = self._task.advance, part
        self._everywhere = np.ones(len(part.env_ids), bool)
        self._over = ~self._everywhere  # begin anew at the next step
        self._rows: Arrays = {}

    def shapes(self) -> Shapes:
        """Return which arrays a vector needs."""
        shapes: dict[str, tuple[tuple[int, ...], str]] = {
            "action": (self._task.single_action_space.shape, "float32"),
            "reward": ((), "float64" if self._task.double_rewards else "float32"),
            "terminated": ((), "bool"),
            "truncated": ((), "bool"),
        }
        shown = {name: (x.shape[1:], str(x.dtype)) for name, x in _named(*self._task.start)}
        shown[SEEDS] = ((), "int64")
        shapes.update(shown)
        if self._part.autoreset is AutoresetMode.SAME_STEP:
            shapes["restarted"] = ((), "bool")
            shapes.update({FINAL + name: entry for name, entry in shown.items()})
        return shapes

    def attach(self, arrays: Arrays) -> None:
        """Take its rows of arrays, and write what the environments look like into them."""
        self._rows = {name: x[self._part.start : self._part.stop] for name, x in arrays.items()}
        self._task.trust(self._rows["action"])  # the vector writes only what it has checked
        self._write(*self._task.start)
        self._rows[SEEDS][:] = self._task.seeds

    def reset(self, env_ids: Sequence[int], seeds: Sequence[int | None], reconfigure: bool) -> None:
        """Begin new episodes.

        Args:
            env_ids: The environments' numbers in the batch.
            seeds: The seed of each; None lets its random streams run on.
            reconfigure: Whether their worlds are rebuilt.
        """
        seeded = [i for i, seed in zip(env_ids, seeds, strict=True) if seed is not None]
        running_on = [i for i in env_ids if i not in set(seeded)]
        options = {RECONFIGURE: reconfigure}
        for some in (seeded, running_on):
            if some:
                own = [s for s in seeds if s is not None] if some is seeded else None
                self._write(*self._task.reset(own, options, some), some)
        self._rows[SEEDS][:] = self._task.seeds
        self._clear_flags(env_ids)

    def step(self, env_ids: list[int] | None = None) -> None:
        """Advance environments by one control step with the actions in its rows.

        Args:
            env_ids: Their numbers in the batch; all if None. The rows of others stay.
        """
        rows, chosen = self._rows, self._chosen(env_ids)
        over = np.flatnonzero(self._over & chosen).tolist()
        if not over:
            self._move(rows["action"], env_ids)
        else:
            moving = np.flatnonzero(chosen & ~self._over).tolist()
            if moving:
                self._move(np.where(self._over[:, None], np.float32(0.0), rows["action"]), moving)
            self._write(*self._task.reset(env_ids=over), over)
            rows["reward"][over] = 0.0
            self._clear_flags(over)
        ended = rows["terminated"] | rows["truncated"]
        if self._part.autoreset is AutoresetMode.NEXT_STEP:
            self._over = ended
        elif self._part.autoreset is AutoresetMode.SAME_STEP:
            self._restart(ended & chosen, chosen)

    def render(self) -> NDArray[np.uint8]:
        """Return a picture of every environment."""
        return self._task.render()

    def close(self) -> None:
        """Let the worlds and the arrays go."""
        self._task.close()
        self._rows = {}

    # -- inside ------------------------------------------------------------------------------

    def _chosen(self, env_ids: list[int] | None) -> NDArray[np.bool_]:
        if env_ids is None:
            return self._everywhere
        chosen = np.zeros_like(self._everywhere)
        chosen[env_ids] = True
        return chosen

    def _move(self, action: NDArray[np.float32], env_ids: list[int] | None) -> None:
        obs, reward, terminated, truncated, info = self._step(action, env_ids)
        self._write(obs, info, env_ids)
        rows, which = self._rows, slice(None) if env_ids is None else env_ids
        ends = not self._part.ignore_terminations
        rows["reward"][which] = as_array(reward)[which]
        rows["terminated"][which] = as_array(terminated)[which] if ends else False
        rows["truncated"][which] = as_array(truncated)[which]

    def _restart(self, ended: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> None:
        rows, ids = self._rows, np.flatnonzero(ended).tolist()
        rows["restarted"][chosen] = ended[chosen]
        if ids:
            for name in [name for name in rows if name.startswith(FINAL)]:
                rows[name][ids] = rows[name.removeprefix(FINAL)][ids]
            self._write(*self._task.reset(env_ids=ids), ids)

    def _write(self, obs: Any, info: Mapping[str, Any], ids: Sequence[int] | None = None) -> None:
        which = slice(None) if ids is None else ids
        for name, value in _named(obs, info):
            if name not in self._rows:
                task = self._task.task_class.__name__
                raise TaskError(
                    f"{name!r} was not there at the first reset of {task}; evaluate() and observe()"
                    " must always return the same keys"
                )
            self._rows[name][which] = value[which]

    def _clear_flags(self, ids: Sequence[int]) -> None:
        self._over[ids] = False
        for name in ("terminated", "truncated"):
            self._rows[name][ids] = False


def _named(obs: Any, info: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Go through observation and info by the names of their arrays."""
    for name, value in leaves(obs, OBSERVATION):
        array = as_array(value)
        yield name, array.astype(observed_dtype(array), copy=False)
    for key, value in info.items():
        if key != RECONFIGURE:  # which is no single environment's
            yield f"{INFO}/{key}", as_array(value)


# -- the memory of a vector ----------------------------------------------------------------------


def memory_size(shapes: Shapes, num_envs: int) -> int:
    """Return how many bytes the arrays of a vector take."""
    return sum(_bytes(shape, dtype, num_envs) for shape, dtype in shapes.values())


def lay_out(memory: Any, shapes: Shapes, num_envs: int) -> Arrays:
    """Return the arrays of a vector, each (N, …), in a writable buffer of `memory_size` bytes."""
    arrays, start = Arrays(), 0
    for name, (shape, dtype) in shapes.items():
        full = (num_envs, *shape)
        count = int(np.prod(full))
        arrays[name] = np.frombuffer(memory, dtype, count, start).reshape(full)
        start += _bytes(shape, dtype, num_envs)
    return arrays


def new_shared_memory(size: int) -> int:
    """Return the file descriptor of new memory that processes can share.

    It has no name: the kernel frees it with the last process that has it open, however that ends.

    Raises:
        OSError: If there is too little memory, now rather than when it is written to.
    """
    descriptor = os.memfd_create("robot-layouts")
    try:
        os.posix_fallocate(descriptor, 0, size)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def map_memory(descriptor: int, size: int) -> mmap.mmap:
    """Return shared memory as a buffer; closes the file descriptor."""
    try:
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


def _bytes(shape: tuple[int, ...], dtype: str, num_envs: int) -> int:
    exact = int(np.prod((num_envs, *shape))) * np.dtype(dtype).itemsize
    return max(-(-exact // _ALIGNMENT), 1) * _ALIGNMENT
