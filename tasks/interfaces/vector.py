"""A task as a Gymnasium vector: many environments, in worker processes or in this one."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import wraps
from threading import Lock
from typing import Any, ClassVar, Concatenate, ParamSpec, TypeVar

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.operating_system import HAS_WORKERS, cores
from robots import SimulationError, TaskError, UnknownNameError, unknown_name_message
from tasks.arrays import nested, row_of
from tasks.engine.actions import ActionReader
from tasks.engine.checks import RECONFIGURE, SUCCESS, checked_ids, checked_options, checked_seeds
from tasks.engine.observation import space_of
from tasks.engine.outcome import SOLVED
from tasks.engine.places import built_layout
from tasks.engine.remade import Remade
from tasks.engine.scenario import RENDER_MODES
from tasks.interfaces.batch import FINAL, INFO, OBSERVATION, BatchPart
from tasks.interfaces.workers import InProcess, VectorWorkerError, Workers, partition
from tasks.language.randomness import FirstSeeds
from tasks.registry import get_task_class, make_scenario

_Flags = NDArray[np.bool_]
_Rows = slice | NDArray[np.intp]  # numbers of environments, in ascending order
_ALL = slice(None)
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


class UnknownAttributeError(UnknownNameError, AttributeError):
    """An attribute that environments of a batch do not have (also an ``AttributeError``)."""


def _one_thread(
    method: Callable[Concatenate[VectorTask, _Arguments], _Result],
) -> Callable[Concatenate[VectorTask, _Arguments], _Result]:
    """Let one thread at a time call a vector: a second would read the first one's answers."""

    @wraps(method)
    def call(self: VectorTask, *args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        if self.busy.locked():
            raise SimulationError(
                "this vector is in the middle of another call; give each thread a vector of its"
                " own, or let them take turns"
            )
        with self.busy:  # Ctrl-C cannot come between taking it and being sure to let it go
            return method(self, *args, **kwargs)

    return call


class VectorTask(Remade, VectorEnv[Any, NDArray[np.float32], NDArray[Any]]):
    """What ``gymnasium.make_vec("RobotLayouts/PickCube-v1", num_envs=64)`` gives.

    Environment i of N is environment i of ``tasks.make(task_id, num_envs=N)``, bit for bit,
    whatever the number of workers. Every worker holds some consecutive environments; actions and
    results go through memory that all processes share.

    `step` waits for all environments. `send` gives actions to any of them, and `recv` returns the
    first ``batch_size`` that are ready.

    A worker that dies, hangs or fails is reported as a `VectorWorkerError` with its environments
    and their seeds. The others are as if nothing had happened, and `restart` replaces it. If Ctrl-C
    interrupts a call, some environments may have taken the step and others not.

    One thread at a time may call it, in the process that made it: a fork needs one of its own. It
    is copied and pickled by how it was made; copies have worlds and workers of their own.

    Attributes:
        num_envs: Number of environments N.
        num_workers: Number of worker processes; 0 if the environments are in this one.
        batch_size: How many environments `recv` returns.
        autoreset_mode: What happens after an episode's last step.
        action_split: Robot name → slice of one environment's action.
        busy: Locked while a thread calls it.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": [*RENDER_MODES], "render_fps": 20}

    def __init__(
        self,
        task_id: str,
        num_envs: int = 1,
        num_workers: int | None = None,
        batch_size: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        ignore_terminations: bool = False,
        timeout: float | None = 60.0,
        render_mode: str | None = None,
        **fields: Any,
    ) -> None:
        """Start the workers and build the worlds.

        Args:
            task_id: The task's id or another of its names.
            num_envs: Number of environments.
            num_workers: Number of processes; None takes one per core, 0 this process.
            batch_size: How many environments `recv` returns; all if None. A worker that holds
                more goes on with others while a policy looks at these.
            autoreset_mode: What happens after an episode's last step. With ``NEXT_STEP`` the next
                step begins a new one, without reading the action; with ``SAME_STEP`` the same
                step does, and ``info`` keeps ``final_obs`` and ``final_info``; with ``DISABLED``
                nothing does, and stepping past the end is allowed.
            ignore_terminations: Whether nothing ends an episode but its last step, and
                ``terminated`` is always false; ``info`` still has ``success``. A policy that
                learns from dense rewards, which success would cut short, else learns to avoid it.
            timeout: Seconds that workers may take for a step or a reset; None waits for ever.
            render_mode: What to draw for people, which needs a Vulkan driver; see `tasks.Scenario`.
            fields: Other arguments of `tasks.make`.

        Raises:
            UnknownNameError: If the task, a place, a robot or a field is unknown.
            TaskError: If the task cannot be made like that.
            AssetError: If robot files cannot be found.
            VectorWorkerError: If a worker ends before it is ready.
        """
        self.busy = Lock()
        mode = checked_mode(autoreset_mode)
        cls = get_task_class(task_id)
        scenario = make_scenario(cls, num_envs, render_mode=render_mode, **fields)
        scenario.check(cls.reward_modes)
        workers = _checked_workers(num_workers, num_envs)
        self.num_envs, self.num_workers, self.render_mode = num_envs, workers, render_mode
        self.autoreset_mode = mode
        frames = round(scenario.control_frequency)
        self.metadata = {**self.metadata, "autoreset_mode": mode, "render_fps": frames}  # type: ignore[misc]
        layout = built_layout(cls, scenario)
        self.action_split = layout.action_split
        self._reader = ActionReader(layout, num_envs)
        self._seeds = [cls.first_seed + i for i in range(num_envs)]
        self._first = FirstSeeds(num_envs)
        self._everywhere = np.ones(num_envs, bool)
        self.batch_size = _checked_batch_size(batch_size, num_envs)
        parts = [
            [BatchPart(cls, scenario, i.start, i.stop, mode, ignore_terminations) for i in own]
            for own in partition(num_envs, workers, self.batch_size)
        ]
        for placement in layout.values():  # fetched here, not by all workers at once
            placement.robot.urdf.locate(pictures=bool(scenario.draws))
        self._process = os.getpid()
        self._backend = Workers(parts, timeout, self._seeds) if workers else InProcess(parts[0])
        self._close = weakref.finalize(self, self._backend.close)
        self._results = _Results(self._backend, num_envs)
        low, high = np.array(layout.action_bounds, np.float32).T
        self.single_action_space = Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.single_observation_space = space_of(self._results.observation(), batched=True)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @_one_thread
    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: ``k`` seeds environment i with k + i; a list gives each its own; None lets the
                random streams run on, the first time from a seed that the system's entropy gives.
            options: ``{"reset_mask": mask}`` resets only where the mask, (N,) bool, is true;
                ``{"reconfigure": True}`` rebuilds the worlds. Others are ignored.

        Returns:
            Observation of all environments and info, which is about those that were reset:
            ``info["seed"]`` is what their random streams began with, (N,) int64.

        Raises:
            TaskError: If an argument is not valid; nothing is reset then.
            VectorWorkerError: If workers die, hang or fail.
        """
        mask, reconfigure = self._checked_options(options)
        everyone = range(self.num_envs)
        seeds = self._first.fill(checked_seeds(seed, everyone), everyone)
        if seed is None or isinstance(seed, int):
            super().reset(seed=seed)
        ids = np.flatnonzero(mask).tolist()
        self._call(
            "reset", self._reset_arguments(ids, seeds, reconfigure), lambda: self._after_reset(mask)
        )
        self._backend.pending.forget(ids)
        self._first.given(ids)
        self._keep_seeds(ids, seeds)
        return self._after_reset(mask)

    @_one_thread
    def step(self, actions: Any) -> tuple[Any, NDArray[np.float32], _Flags, _Flags, dict[str, Any]]:
        """Advance every environment by one control step.

        Args:
            actions: (N, A) floating, in the order of ``action_split``, or a mapping robot name →
                (N, a).

        Returns:
            Observation, reward (N,) float32, terminated (N,), truncated (N,), info.

        Raises:
            ActionError: If the action has a wrong shape, type or number; nothing moves then.
            SimulationError: If environments were sent actions and not received since.
            VectorWorkerError: If workers die, hang or fail; its ``results`` are the others'.
        """
        self._expect_workers()
        self._expect_idle(self._backend.pending.env_ids)
        self._backend.arrays["action"][:] = self._reader.read(actions)
        self._call("step", {i: () for i in range(len(self._backend.parts))}, self._results.step)
        return self._results.step()

    @_one_thread
    def send(self, actions: Any, env_ids: Sequence[int] | NDArray[np.integer[Any]]) -> None:
        """Let some environments take a step, and wait for none.

        Args:
            actions: A row for each of them, (n, A) floating, or a mapping robot name → (n, a).
            env_ids: Their numbers, such as ``info["env_id"]`` of `recv`.

        Raises:
            ActionError: If the action has a wrong shape, type or number; nothing moves then.
            TaskError: If there is no such environment, or one is named twice.
            SimulationError: If one was sent an action before and not received since.
            VectorWorkerError: If workers are gone.
        """
        self._expect_workers()
        ids = self._checked_ids(env_ids)
        self._expect_idle(set(self._backend.pending.env_ids).intersection(ids.tolist()))
        rows = self._reader.read(actions, ids)
        self._backend.arrays["action"][ids] = rows
        for part, own in self._by_part(ids):
            self._backend.send(part, own)

    @_one_thread
    def recv(self) -> tuple[Any, NDArray[np.float32], _Flags, _Flags, dict[str, Any]]:
        """Wait until ``batch_size`` environments have taken the step that they were sent.

        Those that are ready first come back, in ascending order; the others go on. Each
        environment's episodes are what they would be in `step`, bit for bit.

        Returns:
            Observation, reward, terminated, truncated and info as `step` returns them, with a row
            for each environment that came back; ``info["env_id"]`` has their numbers, (n,).

        Raises:
            SimulationError: If fewer environments were sent actions.
            VectorWorkerError: If workers die, hang or fail. What the others were sent can be
                received after `restart`.
        """
        self._expect_workers()
        if (sent := len(self._backend.pending.env_ids)) < self.batch_size:
            raise SimulationError(
                f"recv() returns {self.batch_size} environments, and {sent} were sent actions;"
                " send() more, or make the vector with a smaller batch_size"
            )
        ids = np.array(self._backend.take(self.batch_size))
        obs, reward, terminated, truncated, info = self._results.step(ids)
        return obs, reward, terminated, truncated, {**info, "env_id": ids}

    @_one_thread
    def restart(self, seed: Mapping[int, int] | None = None) -> tuple[Any, dict[str, Any]]:
        """Replace the workers that are gone; their environments begin new episodes.

        Args:
            seed: Environment → seed, for some that are gone; the others take the last seed that
                they were given.

        Returns:
            Observation and info of all environments; those that were not gone are as they were.

        Raises:
            TaskError: If a seed is not valid, or of an environment that is not gone.
            VectorWorkerError: If a worker ends before it is ready; another attempt is allowed.
        """
        self._expect_open()
        gone = sorted(self._backend.failures)
        ids = [i for worker in gone for i in self._backend.env_ids(worker)]
        given = dict(seed or {})
        if wrong := [i for i in given if i not in ids]:
            raise TaskError(f"environments {wrong} are not gone; those that are: {ids}")
        wanted = [given.get(i, own) for i, own in enumerate(self._seeds)]
        seeds = checked_seeds(wanted, range(self.num_envs))
        if gone:
            self._backend.restart(gone)
        self._backend.call("reset", self._reset_arguments(ids, seeds, reconfigure=False))
        self._keep_seeds(ids, seeds)
        return self._after_reset(self._everywhere)

    @_one_thread
    def render(self) -> tuple[NDArray[np.uint8], ...]:  # type: ignore[override]
        """Return a picture of every environment, (H, W, 3) uint8 each; see `tasks.TaskEnv.render`.

        Raises:
            TaskError: If it was made without a ``render_mode``.
            VectorWorkerError: If workers die, hang or fail.
        """
        if self.render_mode is None:
            raise TaskError("this task draws no pictures; make it with render_mode='rgb_array'")
        everyone = {i: () for i in range(len(self._backend.parts))}
        pictures = self._call("render", everyone, lambda: None)
        return tuple(picture for i in everyone for picture in pictures[i])

    @_one_thread
    def close_extras(self, **kwargs: Any) -> None:
        """End the workers and let the shared memory go."""
        self._close()

    # -- inside ------------------------------------------------------------------------------

    def _call(
        self,
        method: str,
        arguments: Mapping[int, tuple[Any, ...]],
        results: Callable[[], Any],
    ) -> dict[int, Any]:
        self._expect_workers()
        try:
            return self._backend.call(method, arguments)
        except VectorWorkerError as error:
            error.results = results()
            raise

    def _expect_open(self) -> None:
        if self.closed:
            raise SimulationError("this vector is closed; make a new one")
        if self.num_workers and os.getpid() != self._process:
            raise SimulationError(
                f"this vector belongs to process {self._process}, of which this one is a fork; make"
                " one of its own here"
            )

    def _expect_workers(self) -> None:
        self._expect_open()
        if isinstance(self._backend, Workers) and self._backend.failures:
            raise self._backend.error(list(self._backend.failures.values()))

    def _expect_idle(self, sent: Collection[int]) -> None:
        if sent:
            raise SimulationError(
                f"environments {sorted(sent)} were sent actions before; recv() them first"
            )

    def _reset_arguments(
        self, ids: list[int], seeds: list[int | None], reconfigure: bool
    ) -> dict[int, tuple[Any, ...]]:
        """Return what the parts that environments are in are reset with; see `Batch.reset`."""
        return {
            number: (
                [i - self._backend.parts[number].start for i in own],
                [seeds[i] for i in own],
                reconfigure,
            )
            for number, own in self._by_part(ids)
        }

    def _by_part(self, env_ids: Any) -> Iterator[tuple[int, list[int]]]:
        """Yield the parts that environments are in, by number, and which of them are in each."""
        chosen = np.zeros(self.num_envs, bool)
        chosen[env_ids] = True
        for number, part in enumerate(self._backend.parts):
            own = chosen[part.start : part.stop].nonzero()[0]
            if len(own):
                yield number, (own + part.start).tolist()

    def _keep_seeds(self, ids: list[int], seeds: list[int | None]) -> None:
        for i in ids:
            seed = seeds[i]
            if seed is not None:
                self._seeds[i] = seed

    def _after_reset(self, mask: _Flags) -> tuple[Any, dict[str, Any]]:
        return self._results.observation(), self._results.info(mask)

    # -- checks ------------------------------------------------------------------------------

    def _checked_ids(self, env_ids: Any) -> NDArray[np.intp]:
        ids = checked_ids([] if env_ids is None else env_ids, self.num_envs)
        if not ids:
            raise TaskError(f"env_ids is {env_ids}; one at least is needed, as of info['env_id']")
        return np.array(ids, np.intp)

    def _checked_options(self, options: Mapping[str, Any] | None) -> tuple[_Flags, bool]:
        options = checked_options(options)
        mask = options.get("reset_mask")
        if mask is None:
            mask = self._everywhere
        elif not (
            isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,)
        ):
            raise TaskError(
                f"reset_mask must be an array of {self.num_envs} booleans, not {mask!r}"
            )
        elif not mask.any():
            raise TaskError("reset_mask is false everywhere; it must be true somewhere")
        return mask, bool(options.get(RECONFIGURE, False))


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return a mode by itself, its value or its name.

    Raises:
        TaskError: If there is no such mode.
    """
    for choice in AutoresetMode:
        if mode in (choice, choice.value, choice.name):
            return choice
    choices = [choice.name for choice in AutoresetMode]
    raise TaskError(unknown_name_message("autoreset_mode", mode, choices))


def _checked_workers(num_workers: int | None, num_envs: int) -> int:
    if num_workers is None:
        return min(cores(), num_envs) if HAS_WORKERS else 0
    if not (isinstance(num_workers, int) and 0 <= num_workers <= num_envs):
        raise TaskError(
            f"num_workers is {num_workers!r}; it must be an integer from 0 to the number of"
            f" environments, {num_envs}"
        )
    return num_workers


def _checked_batch_size(batch_size: int | None, num_envs: int) -> int:
    if batch_size is None:
        return num_envs
    return checked_whole("batch_size", batch_size, 1, num_envs, TaskError)


class _Results:
    """Copies what the arrays say of environments, in the form of Gymnasium's vectors."""

    def __init__(self, backend: InProcess | Workers, num_envs: int) -> None:
        """Take what has the arrays, and how many environments they are of."""
        self._backend = backend
        self._everywhere = np.ones(num_envs, bool)
        self._names: dict[str, list[tuple[str, str]]] = {}

    def step(
        self, ids: _Rows = _ALL
    ) -> tuple[Any, NDArray[np.float32], _Flags, _Flags, dict[str, Any]]:
        """Return what a step has given for some environments."""
        arrays = self._backend.arrays
        info = self.info(self._everywhere[ids], ids)
        restarted = arrays.get("restarted")
        if restarted is not None and restarted[ids].any():
            info.update(self._final(restarted[ids].copy(), ids))
        flags = (arrays[name][ids].copy() for name in ("reward", "terminated", "truncated"))
        return self.observation(ids), *flags, info

    def observation(self, ids: _Rows = _ALL, prefix: str = "") -> Any:
        """Return what is observed of some environments, or of those that ended (`FINAL`)."""
        arrays = self._backend.arrays
        if prefix + OBSERVATION in arrays:
            return arrays[prefix + OBSERVATION][ids].copy()
        inside = f"{prefix}{OBSERVATION}/"
        found = {
            name.removeprefix(inside): array[ids].copy()
            for name, array in arrays.items()
            if name.startswith(inside)
        }
        return nested(found) or np.empty((len(self._everywhere[ids]), 0), np.float32)

    def info(self, mask: _Flags, ids: _Rows = _ALL, prefix: str = INFO) -> dict[str, Any]:
        """Return the info of some environments, as Gymnasium's own vectors return it.

        Args:
            mask: Which of these environments it is about.
            ids: The environments.
            prefix: What the names of the arrays begin with.
        """
        info: dict[str, Any] = {}
        everywhere = mask.all()
        for key, array in self._entries(prefix):
            text = array.dtype.kind == "U"
            info[key] = array[ids].astype(object if text else array.dtype)
            if not everywhere:
                info[key][~mask] = None if text else np.zeros((), array.dtype)
            info[f"_{key}"] = mask.copy()
        return info

    def _entries(self, prefix: str) -> list[tuple[str, NDArray[Any]]]:
        """Return the arrays whose names begin with a prefix, and what info calls them."""
        if prefix not in self._names:
            found = [
                (called, name)
                for name in self._backend.arrays
                for first, _, key in [name.partition("/")]
                if first == prefix
                for called in ((key, SUCCESS) if key == SOLVED else (key,))
            ]
            self._names[prefix] = found
        arrays = self._backend.arrays
        return [(called, arrays[name]) for called, name in self._names[prefix]]

    def _final(self, ended: _Flags, ids: _Rows) -> dict[str, Any]:
        observations = np.full(len(ended), None, object)
        batch = self.observation(ids, FINAL)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = row_of(batch, i)
        return {
            "final_obs": observations,
            "_final_obs": ended,
            "final_info": self.info(ended, ids, FINAL + INFO),
            "_final_info": ended.copy(),
        }
