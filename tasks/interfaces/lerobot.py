"""A task as LeRobot's evaluation wants its vectors: its names for what is seen, whole episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from robots import TaskError, unknown_name_message
from tasks.description import instruction_of
from tasks.engine.checks import INSTRUCTION, RECONFIGURE, SUCCESS
from tasks.engine.remade import Remade
from tasks.interfaces.vector import UnknownAttributeError, VectorTask
from tasks.registry import get_task_class

OBS_MODES = ("lerobot", "lerobot+video", "lerobot+cameras")
STATES = {  # what LeRobot's evaluation wants to be given → the column of datasets it makes of it
    "agent_pos": "observation.state",
    "velocity": "observation.velocity",
    "environment_state": "observation.environment_state",
}
PIXELS = "pixels"  # pictures by camera
PICTURES = "observation.images."  # and the name of a camera: their column
_NOTHING = np.zeros((32, 32, 3), np.uint8)  # a frame of films where nothing is drawn


class LeRobotTask(Remade, VectorEnv[dict[str, Any], NDArray[np.float32], NDArray[Any]]):
    """What `tasks.lerobot_vec_env` gives: a `VectorTask` as LeRobot's evaluation uses it.

    Every reset rebuilds the worlds, so that the episode of a seed is that of `evaluate`,
    bit for bit, whatever was played before. An environment whose episode is over keeps its
    ``terminated``, ``truncated`` and ``is_success`` until it is reset, and earns 0.

    Attributes:
        vector: The Gymnasium vector behind it; ``vector.restart`` replaces workers that are gone.
        action_split: Robot name → slice of one environment's action.
    """

    def __init__(
        self,
        task_id: str,
        num_envs: int = 1,
        *,
        obs_mode: str = "lerobot",
        instruction: str | None = None,
        **fields: Any,
    ) -> None:
        """Start the workers and build the worlds; see `tasks.lerobot_vec_env`."""
        if obs_mode not in OBS_MODES:
            raise TaskError(unknown_name_message("obs_mode", obs_mode, OBS_MODES))
        if "autoreset_mode" in fields:
            raise TaskError("lerobot_vec_env takes no autoreset_mode: LeRobot resets all at once")
        fields |= {"autoreset_mode": AutoresetMode.DISABLED, "obs_mode": obs_mode}
        cls = get_task_class(task_id)
        self.vector = VectorTask(task_id, num_envs, **fields)
        self.num_envs, self.render_mode = num_envs, self.vector.render_mode
        self.metadata, self.action_split = self.vector.metadata, self.vector.action_split
        self.action_space = self.vector.action_space
        self.single_action_space = self.vector.single_action_space
        self.single_observation_space = _renamed_space(self.vector.single_observation_space)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shared: dict[str, Any] = {
            "_max_episode_steps": fields.get("max_episode_steps") or cls.max_episode_steps,
            "metadata": self.metadata,
            "task": cls.task_id,
            "task_description": instruction or instruction_of(cls),
        }
        self._told = instruction is None and isinstance(cls.instruction, tuple)
        self._instructions = [self._shared["task_description"]] * num_envs
        self._terminated, self._truncated, self._solved = np.zeros((3, num_envs), bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin new episodes, in worlds that are built anew.

        Args:
            seed: ``k`` seeds environment i with k + i; a list gives each its own; None lets the
                random streams run on.
            options: As those of `VectorTask.reset`; LeRobot's own are ignored.

        Raises:
            TaskError: If an argument is not valid; nothing is reset then.
            VectorWorkerError: If workers die, hang or fail.
        """
        if options is None or isinstance(options, Mapping):
            options = {RECONFIGURE: True, **(options or {})}
        observation, info = self.vector.reset(seed=seed, options=options)
        begun = (options or {}).get("reset_mask", slice(None))
        for flags in (self._terminated, self._truncated, self._solved):
            flags[begun] = False
        if self._told:
            told = zip(info[INSTRUCTION].tolist(), self._instructions, strict=True)
            self._instructions = [new or old for new, old in told]
        return renamed(observation), info

    def step(
        self, actions: Any
    ) -> tuple[
        dict[str, Any], NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """Advance every environment by one control step.

        Args:
            actions: (N, A) floating, in the order of ``action_split``.

        Returns:
            Observation, reward (N,) float32, terminated (N,), truncated (N,) and info, whose
            ``is_success`` says which episodes have ended in success.

        Raises:
            ActionError: If the action has a wrong shape, type or number; nothing moves then.
            VectorWorkerError: If workers die, hang or fail.
        """
        observation, reward, terminated, truncated, info = self.vector.step(actions)
        running = ~(self._terminated | self._truncated)
        self._terminated |= terminated & running
        self._truncated |= truncated & running
        self._solved |= info.get(SUCCESS, False) & (terminated | truncated) & running
        info[SUCCESS] = self._solved.copy()
        reward[~running] = 0.0
        flags = self._terminated.copy(), self._truncated.copy()
        return renamed(observation), reward, *flags, info

    def render(self) -> tuple[NDArray[np.uint8], ...]:  # type: ignore[override]
        """Return a picture of every environment, (512, 512, 3) uint8 each.

        Raises:
            TaskError: If it was made without a ``render_mode``.
            VectorWorkerError: If workers die, hang or fail.
        """
        return self.vector.render()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return an attribute of each environment, or with ``"render"`` a picture of each.

        LeRobot films the first episodes whether the task draws pictures or not: without
        ``render_mode``, the pictures are black.

        Raises:
            UnknownAttributeError: If environments have no such attribute (also an
                ``AttributeError``).
        """
        if name == "render":
            return self.render() if self.render_mode else (_NOTHING,) * self.num_envs
        if name not in self._shared:
            raise UnknownAttributeError("attribute", name, [*self._shared, "render"])
        if name == "task_description":
            return tuple(self._instructions)
        return (self._shared[name],) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment; see `call`."""
        return self.call(name)

    def close_extras(self, **kwargs: Any) -> None:
        """End the workers and let the shared memory go."""
        self.vector.close()


def renamed(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return columns of a dataset under the names that LeRobot's evaluation wants."""
    states = {name: columns[column] for name, column in STATES.items() if column in columns}
    pictures = {
        column.removeprefix(PICTURES): seen
        for column, seen in columns.items()
        if column.startswith(PICTURES)
    }
    return {**states, PIXELS: pictures} if pictures else states


def _renamed_space(space: Space[Any]) -> Dict:
    assert isinstance(space, Dict)
    parts = renamed(space.spaces)
    return Dict({name: Dict(x) if isinstance(x, dict) else x for name, x in parts.items()})
