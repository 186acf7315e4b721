"""Experts' plans in any control mode: what they drive joints to, as actions of that mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.playing.mode_conversion import converted_steps, followed
from robot_layouts.experts.registry import Expert
from robot_layouts.experts.rehearsal import rehearsed
from robots import CONTROL_MODES, TaskError
from tasks import TaskEnv
from tasks.driving import driven_groups
from tasks.episode import PlayedEpisode

DELTAS, POSITIONS = CONTROL_MODES[:2]  # all experts plan in deltas


class Planner:
    """What an expert does in the episodes of a task, in the task's control mode.

    Attributes:
        reason: Why its last plan does not solve the episode, in words, if the expert says so.
        rehearsed: The episode of its last plan, if that has happened already; see
            `robot_layouts.experts.rehearsal.rehearsed`.
    """

    def __init__(self, task: TaskEnv, expert: Expert) -> None:
        """Make a task in deltas for the expert to plan for, if this one is in another mode."""
        self._task, self._expert, self._played, self.reason = task, expert, task, ""
        self.rehearsed: PlayedEpisode | None = None
        self._converts = task.control_mode != DELTAS
        if self._converts:
            self._task = task.task_class(replace(task.scenario, control_mode=DELTAS))

    def __call__(self, seed: int) -> NDArray[np.float32]:
        """Return the actions (T, A) of the episode that ``seed`` begins.

        In positions they move everything as planned, to the last bit; in other modes nearly, and
        the task is stepped to find them.
        """
        actions = self._expert(self._task, seed)
        self.reason = getattr(actions, "reason", "")
        if not self._converts:
            self.rehearsed = rehearsed(self._task, seed, actions)
            return actions
        if self._played.control_mode == POSITIONS:
            return as_positions(self._task, seed, actions)
        return converted_steps(self._task, seed, actions, self._played)[0]

    def close(self) -> None:
        """Let the worlds of its own task go, if it made one."""
        if self._converts:
            self._task.close()


def as_positions(task: TaskEnv, seed: int, actions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the actions in ``pd_joint_pos`` that move everything as these do, to the last bit.

    The episode is played once, and the drive targets of each step are kept.

    Args:
        task: A task with one environment in ``pd_joint_delta_pos``.
        seed: The episode.
        actions: Shape (T, A).

    Returns:
        Shape (T, A): joint positions for every group that was relative (rad, m), the other
        numbers as they are.

    Raises:
        TaskError: If the task is in another control mode.
    """
    if task.control_mode != DELTAS:
        raise TaskError(f"actions of {DELTAS} are converted; the task has {task.control_mode}")
    positions = np.array(actions, np.float32)
    targets = followed(task, seed, positions).targets
    for driven in driven_groups(task.layout):
        if driven.group.delta:
            positions[:, driven.numbers] = targets[:, driven.joints][:, : driven.group.size]
    return positions
