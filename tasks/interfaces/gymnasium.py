"""A task as a Gymnasium environment: one environment, NumPy in and out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import logger
from numpy.typing import NDArray

from robots import TaskError
from tasks.engine.checks import RECONFIGURE, SEED, SUCCESS, checked_seeds, own_options
from tasks.engine.observation import observed_dtype, space_of
from tasks.engine.outcome import SOLVED
from tasks.engine.remade import Remade
from tasks.engine.scenario import RENDER_MODES
from tasks.language.randomness import FirstSeeds
from tasks.registry import make


class OneEnvironment(Remade):
    """What interfaces to a task with one environment share.

    Attributes:
        task: The task.
        render_mode: What it draws for people; see `tasks.Scenario`.
    """

    def _make(self, task_id: str, render_mode: str | None, fields: Mapping[str, Any]) -> int:
        """Make the task; returns how many control steps a second has, to the next integer."""
        self.task = make(task_id, render_mode=render_mode, **fields)
        self.render_mode = render_mode
        self._step = self.task.advance
        self._first = FirstSeeds(1)
        self._seed = self.task.seeds[0]
        return round(self.task.scenario.control_frequency)

    def _begin(
        self, seed: int | None, options: dict[str, Any] | None
    ) -> tuple[Any, dict[str, Any], int | None]:
        """Begin a new episode; returns the observation, the info and the seed that was drawn."""
        known = own_options(options)
        own = self._first.fill(checked_seeds(seed, (0,)), (0,))
        obs, info = self.task.reset(own, known)
        self._first.given((0,))
        self._seed = self.task.seeds[0]
        return obs, info_row(info, self._seed), own[0]

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture, (H, W, 3) uint8; see `tasks.TaskEnv.render`.

        Without a ``render_mode``, this warns and returns None, as Gymnasium's interface
        asks: trainers call it whether pictures are wanted or not.
        """
        if self.render_mode is None:
            logger.warn("this task draws no pictures; make it with render_mode='rgb_array'")
            return None
        return self.task.render()[0]

    def close(self) -> None:
        """Let the world go."""
        self.task.close()


class GymnasiumTask(OneEnvironment, gymnasium.Env[Any, NDArray[np.float32]]):
    """What ``gymnasium.make("RobotLayouts/PickCube-v1")`` gives.

    The first ``reset`` without a seed draws one from the system's entropy; later ones let the
    random streams run on. ``info["seed"]`` is what they began with: ``reset(seed=info["seed"])``
    plays the same episodes again.

    Gymnasium's time limit truncates episodes, as of all environments that ``gymnasium.make``
    gives: after the task's steps, or the ``max_episode_steps`` that it was given.

    Attributes:
        task: The task, with one environment.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": [*RENDER_MODES], "render_fps": 20}

    def __init__(self, task_id: str, render_mode: str | None = None, **fields: Any) -> None:
        """Make the task.

        Args:
            task_id: The task's id or another of its names.
            render_mode: What to draw for people, which needs a Vulkan driver; see `tasks.Scenario`.
            fields: Other arguments of `tasks.make`, without ``num_envs``.

        Raises:
            UnknownNameError: If the task, a place, a robot or a field is unknown.
            TaskError: If the task cannot be made like that.
            AssetError: If robot files cannot be found.
        """
        if "num_envs" in fields:
            raise TaskError("gymnasium.make makes one environment; make_vec takes num_envs")
        if "max_episode_steps" in fields:
            raise TaskError("time limits are gymnasium.make's: gymnasium.make(max_episode_steps=…)")
        frames = self._make(task_id, render_mode, fields)
        self.metadata = {**self.metadata, "render_fps": frames}  # type: ignore[misc]
        self.action_space = self.task.single_action_space
        self.observation_space = space_of(row(self.task.start[0]))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; see `tasks.TaskEnv.reset`.

        Args:
            seed: Seed of the episode; None lets the random streams run on, from entropy.
            options: ``{"reconfigure": True}`` rebuilds the world; others are ignored.

        Returns:
            Observation and info.

        Raises:
            TaskError: If an argument is not valid; nothing is reset then.
        """
        obs, info, own_seed = self._begin(seed, options)
        super().reset(seed=own_seed)
        return row(obs), info

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Shape (A,), in the order of ``task.action_split``.

        Returns:
            Observation, reward, terminated, truncated and info. It is never truncated by itself.
        """
        obs, reward, terminated, _, info = self._step(action)
        ended = bool(terminated[0])
        return row(obs), reward[0].item(), ended, False, info_row(info, self._seed)


# -- what a task returns, as arrays and numbers ---------------------------------------------------


def as_array(value: Any) -> NDArray[Any]:
    """Return what a task gave as an array, which shares its memory."""
    return value if isinstance(value, np.ndarray) else value.numpy()


def row(observation: Any, env: int = 0) -> Any:
    """Return one environment's part of a batched observation, as arrays.

    Images keep their type, all else is float32. Observing nothing gives an array without numbers:
    spaces may be empty, mappings may not.
    """
    if isinstance(observation, Mapping) and not observation:
        return np.empty(0, np.float32)
    if isinstance(observation, Mapping):
        return {key: row(part, env) for key, part in observation.items()}
    return np.array(as_array(observation)[env], observed_dtype(observation))


def info_row(info: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the info of the only environment as Python numbers, and arrays where it has them.

    It has the same keys after a reset and after a step: "reconfigure" is left out.

    Args:
        info: What the task returned.
        seed: What the environment's random streams began with.
    """
    row_info: dict[str, Any] = {
        key: value[0].item() if value.ndim == 1 else as_array(value)[0].copy()
        for key, value in info.items()
        if key != RECONFIGURE
    }
    if SOLVED in row_info:
        row_info[SUCCESS] = row_info[SOLVED]
    row_info[SEED] = seed
    return row_info
