"""Tasks of robot-layouts as environments of LeRobot: ``--env.type=robot_layouts``.

Observations and actions are those of exported datasets, so a policy that was trained on one is
evaluated as it is:

    lerobot-eval --policy.path=outputs/… --env.type=robot_layouts --env.task=PickCube-v1

A policy that was trained on an export with video needs ``--env.video=true``, and one that was
trained on an export with all cameras ``--env.cameras=true`` and, if these were given another size,
``--env.camera_size='[96, 64]'``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_STATE

from tasks import get_task_class
from tasks.description import instruction_of

# What LeRobot's evaluation calls what it renames to the names of datasets.
NAMES = {
    "agent_pos": OBS_STATE,
    "velocity": "observation.velocity",
    "environment_state": OBS_ENV_STATE,
}
PICTURES = "observation.images."  # and the name of a camera
KINDS = {"environment_state": FeatureType.ENV}


class LeRobotNames(gym.ObservationWrapper):
    """Calls observations what LeRobot's evaluation expects, and says what is to be done."""

    def __init__(self, env: gym.Env, task_id: str) -> None:
        """Rename what the environment observes."""
        super().__init__(env)
        self.task = self.task_description = instruction_of(get_task_class(task_id))
        self.observation_space = gym.spaces.Dict(self.observation(env.observation_space))

    def observation(self, observation: Any) -> dict[str, Any]:
        """Return an observation, or its space, under LeRobot's names."""
        known = observation.keys()
        renamed = {key: observation[name] for key, name in NAMES.items() if name in known}
        pixels = {
            name.removeprefix(PICTURES): observation[name]
            for name in known
            if name.startswith(PICTURES)
        }
        if pixels:
            is_space = isinstance(observation, gym.spaces.Dict)
            renamed["pixels"] = gym.spaces.Dict(pixels) if is_space else pixels
        return renamed


@EnvConfig.register_subclass("robot_layouts")
@dataclass
class RobotLayoutsEnv(EnvConfig):
    """A task.

    Attributes:
        task: Its id; ``module:Id`` for one of your own.
        fps: Its control steps per second.
        robots: Other robots for some places: place → robot.
        control_mode: What actions mean; see `tasks.Scenario`.
        video: Whether policies see the pictures of exports with video, which needs a Vulkan driver.
        cameras: Whether policies see those of exports with all cameras, which needs one, too.
        camera_size: Width and height of these (pixels); None: each camera's own.
        render_mode: ``"rgb_array"``, as LeRobot films episodes, which needs one, too, or None.
    """

    task: str = "PickCube-v1"
    fps: int = 20
    robots: dict[str, str] = field(default_factory=dict)
    control_mode: str = "pd_joint_delta_pos"
    video: bool = False
    cameras: bool = False
    camera_size: list[int] | None = None
    render_mode: str | None = "rgb_array"

    def __post_init__(self) -> None:
        """Read off the task what policies are given and give."""
        env = self._make()
        self.features = {ACTION: PolicyFeature(FeatureType.ACTION, env.action_space.shape)}
        self.features_map = {ACTION: ACTION}
        for key, name in NAMES.items():
            if key in env.observation_space.spaces:
                kind, shape = KINDS.get(key, FeatureType.STATE), env.observation_space[key].shape
                self.features[key], self.features_map[key] = PolicyFeature(kind, shape), name
        for camera, space in env.observation_space.spaces.get("pixels", {}).items():
            key = f"pixels/{camera}"
            self.features[key] = PolicyFeature(FeatureType.VISUAL, space.shape)
            self.features_map[key] = f"{PICTURES}{camera}"
        env.close()

    @property
    def package_name(self) -> str:
        """The module that registers tasks."""
        return "tasks"

    @property
    def gym_id(self) -> str:
        """What ``gym.make`` knows the task by."""
        module, _, task = self.task.rpartition(":")
        return f"{module or 'tasks'}:RobotLayouts/{task}"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of ``gym.make``."""
        return {
            "obs_mode": "lerobot" + "+video" * self.video + "+cameras" * self.cameras,
            "camera_size": self.camera_size,
            "robots": self.robots or None,
            "control_mode": self.control_mode,
            "control_frequency": self.fps,
            "render_mode": self.render_mode,
        }

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, gym.vector.VectorEnv]]:
        """Return the environments by suite and number, of which there is one each."""
        makers = [self._make] * n_envs
        mode = AutoresetMode.SAME_STEP
        if use_async_envs and n_envs > 1:
            vector = AsyncVectorEnv(makers, autoreset_mode=mode, context="forkserver")
        else:
            vector = SyncVectorEnv(makers, autoreset_mode=mode)
        return {self.type: {0: vector}}

    def _make(self) -> LeRobotNames:
        return make(self.gym_id, self.task, self.gym_kwargs)


def make(gym_id: str, task_id: str, arguments: dict[str, Any]) -> LeRobotNames:
    """Make one environment."""
    return LeRobotNames(gym.make(gym_id, **arguments), task_id)
