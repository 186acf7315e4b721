"""Plays actions through a task and keeps everything that happened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import TaskError
from tasks import MultiRobotTask

States = dict[str, dict[str, NDArray[np.float32]]]

REBUILT: dict[str, Any] = {"reconfigure": True}  # reset option: nothing of the past stays in PhysX


@dataclass(frozen=True)
class Episode:
    """One episode of T steps.

    Attributes:
        seed: Seed of its reset, which rebuilt the world.
        actions: Shape (T, A).
        states: State dict of `MultiRobotTask.get_state_dict`, each entry (T + 1, k), the first
            row being the state after the reset.
        rewards: Shape (T,).
        success: Shape (T,).
        terminated: Shape (T,).
        truncated: Shape (T,).
        seconds: Time that the steps took, without reading the states (s).
    """

    seed: int
    actions: NDArray[np.float32]
    states: States
    rewards: NDArray[np.float32]
    success: NDArray[np.bool_]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    seconds: float

    @property
    def solved(self) -> bool:
        """Whether the last step ended in success."""
        return bool(self.success[-1])


def play(
    task: MultiRobotTask,
    seed: int,
    actions: NDArray[np.float32],
    watch: Callable[[], None] = lambda: None,
    *,
    start: Mapping[str, Mapping[str, Any]] | None = None,
) -> Episode:
    """Play actions in a freshly built world.

    Args:
        task: A task with one environment.
        seed: Seed of the reset.
        actions: Shape (T, A) with T of 1 or more.
        watch: Called after the reset and after every step.
        start: State to begin from instead of the one after the reset; see
            `MultiRobotTask.set_state_dict`, which is not exact.

    Raises:
        TaskError: If the task has several environments, or there are no actions.
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    if task.num_envs != 1:
        raise TaskError(f"an episode is played in 1 environment; the task has {task.num_envs}")
    if not len(actions):
        raise TaskError("an episode needs at least one action")
    task.reset(seed, options=REBUILT)
    if start is not None:
        task.set_state_dict(start)
    tape, seconds = task.begin_tape(), 0.0
    rewards = np.empty(len(actions), np.float32)
    success, terminated, truncated = np.empty((3, len(actions)), np.bool_)
    task.write_tape(tape)
    watch()
    for i, action in enumerate(actions):
        began = perf_counter()
        _, reward, ended, cut_off, info = task.step(action)
        seconds += perf_counter() - began
        rewards[i], success[i] = reward.item(), info["success"].item()
        terminated[i], truncated[i] = ended.item(), cut_off.item()
        task.write_tape(tape)
        watch()
    return Episode(
        seed=seed,
        actions=np.asarray(actions, np.float32),
        states={
            kind: {name: rows[:, 0] for name, rows in entries.items()}
            for kind, entries in tape.read().items()
        },
        rewards=rewards,
        success=success,
        terminated=terminated,
        truncated=truncated,
        seconds=seconds,
    )
