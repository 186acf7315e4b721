"""Makes the native ManiSkill environment that a task clones, and speaks its action format."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from robots import CONTROL_MODES, MissingPackageError, SimulationError, TaskError, closest_match

INSTALL = "pip install -e '.[parity]'"

_LOGGER = "mani_skill "  # spelled like this by mani_skill itself
_VULKAN_WORDS = ("vk::", "vulkan", "rendering device")


def make_native(
    task_id: str,
    reward_mode: str | None = None,
    control_mode: str = CONTROL_MODES[0],
    *,
    picture_size: int | None = None,
    obs_mode: str = "state",
    robot_uid: str | None = None,
    sensors: Mapping[str, Any] | None = None,
    **more: Any,
) -> Any:
    """Make the native environment of a task: one environment, CPU physics.

    Args:
        task_id: ManiSkill's id, for example ``"PickCube-v1"``.
        reward_mode: One of the task's reward modes; None takes native's default.
        control_mode: One of `robots.CONTROL_MODES`.
        picture_size: Width and height of its ``render_rgb_array`` (pixels); None takes native's.
        obs_mode: What it observes, in native's words.
        robot_uid: Native's name of its robot; None takes the task's own.
        sensors: Native's ``sensor_configs``; None takes the cameras as they are.
        more: Other arguments of native's.

    Raises:
        MissingPackageError: If mani_skill, or a package that it needs, is not installed.
        SimulationError: If there is no Vulkan driver, without which native builds no scene.
        TaskError: If mani_skill has no such task, or the task no such reward mode or control mode.
    """
    with quiet():
        gym = _import_native()
        _expect_task(task_id, reward_mode)
        chosen = {**more, **({} if reward_mode is None else {"reward_mode": reward_mode})}
        if robot_uid is not None:
            chosen["robot_uids"] = robot_uid
        if sensors is not None:
            chosen["sensor_configs"] = dict(sensors)
        if picture_size is not None:
            chosen["human_render_camera_configs"] = {"width": picture_size, "height": picture_size}
        try:
            return gym.make(
                task_id,
                obs_mode=obs_mode,
                control_mode=control_mode,
                sim_backend="physx_cpu",
                render_backend="cpu",
                **chosen,
            ).unwrapped
        except AssertionError as error:
            if "supported modes" not in str(error):
                raise
            raise TaskError(f"native's {task_id} has no such control mode: {error}") from error
        except RuntimeError as error:
            if not any(word in str(error).lower() for word in _VULKAN_WORDS):
                raise
            raise SimulationError(
                f"native ManiSkill builds no scene without a Vulkan driver, and none works here"
                f" ({error}). A software driver serves: Mesa's lavapipe 24.3 or newer (on Debian,"
                " mesa-vulkan-drivers)"
            ) from error


def make_native_front(task_id: str, obs_mode: str = "state") -> gymnasium.Env[Any, Any]:
    """Make the native environment of a task with NumPy observations, alone in its process."""
    import torch

    torch.set_num_threads(1)
    logging.disable(logging.WARNING)
    native = make_native(task_id, obs_mode=obs_mode)
    with quiet():
        from mani_skill.utils.wrappers.gymnasium import CPUGymWrapper

        return CPUGymWrapper(native)


def native_tasks() -> dict[str, Any]:
    """Return native's registry: task id → its specification, with ``cls`` and what it downloads.

    Raises:
        MissingPackageError: If mani_skill, or a package that it needs, is not installed.
    """
    with quiet():
        _import_native()
        from mani_skill.utils.registration import REGISTERED_ENVS

        return dict(sorted(REGISTERED_ENVS.items()))


def native_agents(env: Any) -> list[Any]:
    """Return the robots of a native environment, in native's order."""
    return list(getattr(env.agent, "agents", None) or [env.agent])


def native_action_dim(env: Any) -> int:
    """Return how many numbers the flat action of all robots has."""
    return sum(agent.single_action_space.shape[0] for agent in native_agents(env))


def native_action(env: Any, flat: NDArray[np.float32]) -> Any:
    """Return a flat action, shape (A,), as native takes it: by robot if there are several.

    Raises:
        TaskError: If it has not as many numbers as the robots take.
    """
    if flat.shape != (native_action_dim(env),):
        raise TaskError(
            f"the action has shape {flat.shape}; native takes {native_action_dim(env)} numbers"
        )
    if not hasattr(env.agent, "agents"):
        return flat
    by_robot: dict[str, NDArray[np.float32]] = {}
    start = 0
    for number, agent in enumerate(native_agents(env)):
        stop = start + agent.single_action_space.shape[0]
        by_robot[f"{agent.uid}-{number}"] = flat[start:stop]
        start = stop
    return by_robot


def _import_native() -> Any:
    try:
        import gymnasium

        import_module("mani_skill.envs")  # registers native's tasks
    except ImportError as error:
        package = (error.name or "mani_skill").partition(".")[0]
        raise MissingPackageError(
            f"comparing with native ManiSkill needs {package}, which cannot be imported"
            f" ({error}); install it with: {INSTALL}"
        ) from error
    return gymnasium


def _expect_task(task_id: str, reward_mode: str | None) -> None:
    from mani_skill.utils.registration import REGISTERED_ENVS

    if task_id not in REGISTERED_ENVS:
        match = closest_match(task_id, REGISTERED_ENVS)
        raise TaskError(
            f"native ManiSkill has no task {task_id!r}, so there is nothing to compare it with."
            + (f" Its closest is {match!r}." if match else "")
        )
    modes = REGISTERED_ENVS[task_id].cls.SUPPORTED_REWARD_MODES
    if reward_mode not in (None, *modes):
        raise TaskError(
            f"native's {task_id} has no reward mode {reward_mode!r}; it has {', '.join(modes)}"
        )


@contextmanager
def quiet() -> Generator[None]:
    """Hold back what mani_skill says while it is imported or builds a scene."""
    logger = logging.getLogger(_LOGGER)
    before, logger.disabled = logger.disabled, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before
