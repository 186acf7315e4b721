"""A task as a Stable-Baselines3 ``VecEnv``: many environments, in worker processes or here."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, NoReturn

import gymnasium
import numpy as np
from gymnasium.spaces import Dict, Space
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnv,
    VecEnvIndices,
    VecEnvObs,
)

from robots import SimulationError, TaskError
from tasks.arrays import leaves
from tasks.engine.checks import RECONFIGURE, own_options
from tasks.engine.remade import Remade
from tasks.interfaces import NAMESPACE
from tasks.interfaces.vector import UnknownAttributeError, VectorTask
from tasks.registry import get_task_class


class SB3Task(Remade, VecEnv):
    """What `tasks.sb3_vec_env` gives: a `VectorTask` that speaks Stable-Baselines3's language.

    An environment whose episode ends begins the next one in the same step. What its last step
    returned is in its info: ``terminal_observation``, ``TimeLimit.truncated`` (its time was up, and
    it had not terminated), ``is_success``, of which Stable-Baselines3 makes success rates, and
    ``episode``, of which it makes ``ep_rew_mean`` and ``ep_len_mean``, as after ``VecMonitor``.
    Nested spaces are unknown to Stable-Baselines3, so parts of an observation are named by their
    path, ``extra/tcp_pose`` or ``sensor_data/base_camera/rgb``.

    Attributes:
        vector: The Gymnasium vector behind it; ``vector.restart`` replaces workers that are gone.
        spec: What Gymnasium calls the task; None if it does not know it.
    """

    def __init__(self, task_id: str, num_envs: int = 1, **fields: Any) -> None:
        """Start the workers and build the worlds; see `tasks.sb3_vec_env`."""
        if "autoreset_mode" in fields:
            raise TaskError(
                "sb3_vec_env takes no autoreset_mode: Stable-Baselines3 resets in the same step"
            )
        fields["autoreset_mode"] = AutoresetMode.SAME_STEP
        self.vector = VectorTask(task_id, num_envs, **fields)
        task = get_task_class(task_id)
        self.spec = gymnasium.registry.get(f"{NAMESPACE}/{task.task_id}")
        observation = _flat_space(self.vector.single_observation_space)
        self._shared: dict[str, Any] = {
            "action_space": self.vector.single_action_space,
            "action_split": self.vector.action_split,
            "max_episode_steps": fields.get("max_episode_steps") or task.max_episode_steps,
            "metadata": self.vector.metadata,
            "observation_space": observation,
            "render_mode": self.vector.render_mode,
            "spec": self.spec,
            "task_id": task.task_id,
        }
        super().__init__(num_envs, observation, self.vector.single_action_space)
        self.metadata = self.vector.metadata
        self._actions: Any = None
        self._returns = np.zeros(num_envs, np.float32)
        self._made = time.time()

    def reset(self) -> VecEnvObs:
        """Begin new episodes, with what `seed` and `set_options` gave for this once.

        ``set_options({"reconfigure": True})`` rebuilds the worlds.

        Returns:
            Observation of all environments.

        Raises:
            TaskError: If a seed or an option is not valid; nothing is reset then.
            VectorWorkerError: If workers die, hang or fail.
        """
        rebuilt = np.array([own_options(options)[RECONFIGURE] for options in self._options])
        obs: Any = None
        for mask, rebuild in ((rebuilt, True), (~rebuilt, False)):
            if mask.any():
                options = {"reset_mask": mask, "reconfigure": rebuild}
                obs, info = self.vector.reset(seed=self._seeds, options=options)
                rows = _rows(info, self.num_envs)
                for i in np.flatnonzero(mask).tolist():
                    self.reset_infos[i] = rows[i]
        self._returns[:] = 0.0
        self._reset_seeds()
        self._reset_options()
        return _flat(obs)

    def step_async(self, actions: Any) -> None:
        """Take the actions of the next step.

        Args:
            actions: (N, A) floating, in the order of ``action_split``.
        """
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[VecEnvObs, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance every environment by one control step.

        Returns:
            Observation, reward (N,) float32, done (N,), and the info of each environment.

        Raises:
            ActionError: If the action has a wrong shape, type or number; nothing moves then.
            SimulationError: If `step_async` has given no actions since the last step.
            VectorWorkerError: If workers die, hang or fail.
        """
        if self._actions is None:
            raise SimulationError("step_wait() has no actions; give them to step_async() before it")
        actions, self._actions = self._actions, None
        obs, reward, terminated, truncated, info = self.vector.step(actions)
        self._returns += reward
        done = terminated | truncated
        infos = _rows(info, self.num_envs)
        if done.any():
            final = _rows(info["final_info"], self.num_envs)
            for i in np.flatnonzero(done).tolist():
                self.reset_infos[i], infos[i] = infos[i], final[i]
                infos[i]["terminal_observation"] = _flat(info["final_obs"][i])
                infos[i]["episode"] = {
                    "r": float(self._returns[i]),
                    "l": infos[i]["elapsed_steps"],
                    "t": round(time.time() - self._made, 6),
                }
            self._returns[done] = 0.0
        for own, late in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            own["TimeLimit.truncated"] = late
        return _flat(obs), reward, done, infos

    def close(self) -> None:
        """End the workers; closing twice is allowed."""
        self.vector.close()

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """Return a picture of every environment, (H, W, 3) uint8 each; see `tasks.TaskEnv.render`.

        Raises:
            TaskError: If it was made without a ``render_mode``.
        """
        return list(self.vector.render())

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of some environments; it is the same for all.

        Raises:
            UnknownAttributeError: If environments have no such attribute (also an
                ``AttributeError``).
        """
        if attr_name not in self._shared:
            raise UnknownAttributeError("attribute", attr_name, self._shared)
        return [self._shared[attr_name] for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> NoReturn:
        """Refuse: environments stay as they were made.

        Raises:
            TaskError: Always.
        """
        raise TaskError(
            f"{attr_name} cannot be set: environments stay as they were made, and share a task"
            " with others; give sb3_vec_env what they should be like"
        )

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> NoReturn:
        """Refuse: environments are rows of a batch and have no methods of their own.

        Raises:
            UnknownAttributeError: Always (also an ``AttributeError``).
        """
        hint = "Environments are rows of a batch; the vector they are in is `vector`."
        raise UnknownAttributeError("method of an environment", method_name, (), hint)

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Return whether environments are in a Gymnasium wrapper: none is."""
        return [False for _ in self._get_indices(indices)]


def _rows(info: Mapping[str, Any], num_envs: int) -> list[dict[str, Any]]:
    """Return the info of each environment: Python numbers, and arrays where it has them."""
    columns = {
        key: list(value) if value.ndim > 1 else value.tolist()
        for key, value in info.items()
        if f"_{key}" in info and not key.startswith("final_")
    }
    return [{key: column[i] for key, column in columns.items()} for i in range(num_envs)]


def _flat_space(space: Space[Any]) -> Space[Any]:
    return Dict(list(leaves(space))) if isinstance(space, Dict) else space


def _flat(observation: Any) -> Any:
    return dict(leaves(observation)) if isinstance(observation, Mapping) else observation
