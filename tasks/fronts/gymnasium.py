"""A task as a Gymnasium environment: one environment, NumPy in and out."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from robots import TaskError
from tasks.fronts.numbers import info_row, row
from tasks.observation import space_of
from tasks.registry import make
from tasks.remade import Remade

RENDER_MODES = ["rgb_array"]


class GymnasiumTask(Remade, gymnasium.Env[Any, NDArray[np.float32]]):
    """What ``gymnasium.make("RobotLayouts/PickCube-v1")`` gives.

    It truncates when the task does; a ``max_episode_steps`` given to ``gymnasium.make`` can only
    end episodes earlier. ``reset`` without a seed lets the task's random streams run on, from
    native's first seed.

    Attributes:
        task: The task, with one environment.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": 20}

    def __init__(self, task_id: str, render_mode: str | None = None, **fields: Any) -> None:
        """Make the task.

        Args:
            task_id: The task's id or another of its names.
            render_mode: ``"rgb_array"`` to draw pictures, which needs a Vulkan driver.
            fields: Other arguments of `tasks.make`, without ``num_envs``.

        Raises:
            UnknownNameError: If the task, a place, a robot or a field is unknown.
            TaskError: If the task cannot be made like that.
            AssetError: If robot files cannot be found.
        """
        if "num_envs" in fields:
            raise TaskError("gymnasium.make makes one environment; make_vec takes num_envs")
        self.task = make(task_id, render_mode=render_mode, **fields)
        self.render_mode = render_mode
        frames = round(self.task.made_from.control_frequency)
        self.metadata = {**self.metadata, "render_fps": frames}  # type: ignore[misc]
        self.action_space = self.task.single_action_space
        self.observation_space = space_of(row(self.task.start[0]))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; see `tasks.MultiRobotTask.reset`.

        Args:
            seed: Seed of the episode; None lets the random streams run on.
            options: ``{"reconfigure": True}`` rebuilds the world.

        Returns:
            Observation and info.
        """
        super().reset(seed=seed)
        obs, info = self.task.reset(seed, options)
        return row(obs), info_row(info)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Shape (A,), in the order of ``task.action_split``.

        Returns:
            Observation, reward, terminated, truncated and info.
        """
        obs, reward, terminated, truncated, info = self.task.step(action)
        flags = bool(terminated[0]), bool(truncated[0])
        return row(obs), reward[0].item(), *flags, info_row(info)

    def render(self) -> NDArray[np.uint8]:  # type: ignore[override]
        """Return a picture, (512, 512, 3) uint8.

        Raises:
            TaskError: If it was not made with ``render_mode="rgb_array"``.
        """
        return self.task.render()[0]

    def close(self) -> None:
        """Let the world go."""
        self.task.close()
