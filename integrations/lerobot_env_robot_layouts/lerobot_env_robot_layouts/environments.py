"""Tasks of robot-layouts as environments of LeRobot: ``--env.type=robot_layouts``.

Observations and actions are those of exported datasets, so a policy that was trained on one is
evaluated as it is:

    lerobot-eval --policy.path=outputs/… --env.type=robot_layouts --env.task=TwoRobotPickCube-v1

A policy that was trained on an export with video needs ``--env.video=true``, and one that was
trained on an export with all cameras ``--env.cameras=true`` and, if these were given another size,
``--env.camera_size='[96, 64]'``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import gymnasium as gym
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig, HubEnvConfig
from lerobot.utils.constants import ACTION

from layouts import Layout
from robots import TaskError
from tasks import Randomization, lerobot_vec_env
from tasks.interfaces.lerobot import PICTURES, PIXELS, STATES, LeRobotTask

KINDS = {"environment_state": FeatureType.ENV}  # the others are states


class Later:
    """A vector that is made when it is first used: of many tasks, only one is alive at a time."""

    def __init__(self, make: Callable[[], LeRobotTask], num_envs: int) -> None:
        """Remember how to make it."""
        self.num_envs = num_envs
        self._make, self._made = make, None

    def __getattr__(self, name: str) -> Any:
        """Return what the vector has, and make it if need be."""
        if name.startswith("_"):  # what other packages look for in vectors of their own
            raise AttributeError(name)
        if self._made is None:
            self._made = self._make()
        return getattr(self._made, name)

    def close(self) -> None:
        """Close the vector, if there is one; another is made when it is used again."""
        if self._made is not None:
            self._made.close()
            self._made = None


@EnvConfig.register_subclass("robot_layouts")
@dataclass
class RobotLayoutsEnv(HubEnvConfig):
    """One or more tasks.

    Attributes:
        task: Its id, ``module:Id`` for one of your own; several, of robots and bodies that are
            observed alike, are joined by commas, and are evaluated one after the other.
        fps: Its control steps per second.
        robots: Other robots for some places: place → robot.
        layout: A file that holds another layout, in YAML.
        randomization: A file that says what varies from episode to episode, in YAML or json.
        control_mode: What actions mean, see `tasks.Scenario`; None: as the layout says.
        instruction: What policies are told to do; None: the task's own sentence.
        video: Whether policies see the pictures of exports with video, which needs a Vulkan driver.
        cameras: Whether policies see those of exports with all cameras, which needs one, too.
        camera_size: Width and height of these (pixels); None: each camera's own.
        max_episode_steps: Control steps until an episode is truncated; None: the task's own.
        render_mode: ``"rgb_array"``, as LeRobot films the first episodes, which needs one, too; or
            None, and the films are black.
        num_workers: How many processes step the environments; None: one per core if LeRobot asks
            for processes, else none but this one.
        timeout: Seconds that these may take for a step or a reset, which is long where a processor
            draws pictures; None: for ever.
        hub_path: A repository of LeRobot's hub whose ``env.py`` makes the environments instead.
    """

    task: str = "PickCube-v1"  # pyright: ignore[reportIncompatibleVariableOverride]
    fps: int = 20
    robots: dict[str, str] = field(default_factory=dict)
    layout: str | None = None
    randomization: str | None = None
    control_mode: str | None = None
    instruction: str | None = None
    video: bool = False
    cameras: bool = False
    camera_size: list[int] | None = None
    max_episode_steps: int | None = None
    render_mode: str | None = "rgb_array"
    num_workers: int | None = None
    timeout: float | None = 600.0

    def __post_init__(self) -> None:
        """Read off the tasks what policies are given and give.

        Raises:
            TaskError: If that is not the same for all tasks, or one cannot be made.
            UnknownNameError: If a task, a place or a robot is unknown.
        """
        first, *others = self.task_ids
        self.features = self._features_of(first)
        for task in others:
            if (own := self._features_of(task)) != self.features:
                differing = sorted(
                    key for key in {*own, *self.features} if own.get(key) != self.features.get(key)
                )
                raise TaskError(
                    f"one policy cannot play both {first} and {task}: {', '.join(differing)} differ"
                )
        self.features_map = {key: STATES.get(key, key) for key in self.features}

    @property
    def task_ids(self) -> list[str]:
        """The tasks one by one."""
        return [task.strip() for task in self.task.split(",")]

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of `tasks.lerobot_vec_env`, besides the task and how many."""
        return {
            "obs_mode": "lerobot" + "+video" * self.video + "+cameras" * self.cameras,
            "camera_size": self.camera_size and tuple(self.camera_size),
            "robots": self.robots or None,
            "layout": self.layout and Layout.load(self.layout),
            "randomization": self.randomization and Randomization.load(self.randomization),
            "control_mode": self.control_mode,
            "control_frequency": self.fps,
            "max_episode_steps": self.max_episode_steps,
            "instruction": self.instruction,
            "render_mode": self.render_mode,
            "timeout": self.timeout,
        }

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, gym.vector.VectorEnv]]:
        """Return the vectors by task, each under the number 0."""
        workers = None if use_async_envs and n_envs > 1 else 0
        workers = workers if self.num_workers is None else self.num_workers
        return {
            task: {0: Later(partial(self._make, task, n_envs, workers), n_envs)}  # type: ignore[dict-item]
            for task in self.task_ids
        }

    def _make(self, task: str, n_envs: int, workers: int | None) -> LeRobotTask:
        return lerobot_vec_env(task, n_envs, workers, **self.gym_kwargs)

    def _features_of(self, task: str) -> dict[str, PolicyFeature]:
        """Return the action, states and pictures of a task."""
        vector = self._make(task, 1, 0)
        vector.close()
        observed, actions = vector.single_observation_space, vector.single_action_space
        assert isinstance(observed, gym.spaces.Dict)
        spaces = dict(observed.spaces)
        pictures = spaces.pop(PIXELS, gym.spaces.Dict())
        assert isinstance(pictures, gym.spaces.Dict)
        features = {ACTION: PolicyFeature(FeatureType.ACTION, actions.shape or ())}
        for name, space in spaces.items():
            features[name] = PolicyFeature(KINDS.get(name, FeatureType.STATE), space.shape or ())
        for camera, space in pictures.spaces.items():
            features[f"{PICTURES}{camera}"] = PolicyFeature(FeatureType.VISUAL, space.shape or ())
        return features
