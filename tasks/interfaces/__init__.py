"""Tasks behind the interfaces of Gymnasium, PettingZoo, Stable-Baselines3 and LeRobot.

Importing this loads neither torch nor sapien; each front is loaded when one is made.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import EnvSpec

from robot_layouts.core.importing import optional
from tasks.registry import get_task_class, list_own

if TYPE_CHECKING:
    from tasks.interfaces.device import DeviceTask
    from tasks.interfaces.lerobot import LeRobotTask
    from tasks.interfaces.parallel import ParallelTask
    from tasks.interfaces.sb3 import SB3Task
    from tasks.interfaces.vector import VectorTask

_GYMNASIUM_NAME = re.compile(r"[\w.-]+-v\d+")

__all__ = ["NAMESPACE", "lerobot_vec_env", "parallel_env", "register", "sb3_vec_env"]


def register(task_ids: Iterable[str]) -> None:
    """Tell Gymnasium tasks that it does not know yet.

    Importing `tasks` does this with all that there are, and registering a task with that one. Names
    that are no Gymnasium ids (those end with ``-v`` and a number) stay unknown to it. Tasks of a
    user's own module go by their plain id, too, unless it is taken: so
    ``gymnasium.make("mylab.tray:TwoArmTray-v1")``, which imports the module and looks the id up,
    finds them.

    Args:
        task_ids: Ids of the tasks.
    """
    from gymnasium import registry

    names = {f"{NAMESPACE}/{task_id}": task_id for task_id in task_ids}
    names |= {task_id: task_id for task_id in list_own()}
    for name, task_id in names.items():
        if _GYMNASIUM_NAME.fullmatch(task_id) and name not in registry:
            registry[name] = TaskSpec(
                name,
                entry_point="tasks.interfaces.gymnasium:GymnasiumTask",
                vector_entry_point="tasks.interfaces:vector_env",
                kwargs={"task_id": task_id},
            )


def vector_env(
    task_id: str, num_envs: int = 1, simulator: str | None = None, **fields: Any
) -> VectorTask | DeviceTask:
    """Make what ``gymnasium.make_vec`` gives of a task.

    Args:
        task_id: The task's id or another of its names.
        num_envs: Number of environments.
        simulator: What simulates them; with ``"mujoco_warp"`` they are on a device, and what
            comes and goes are its tensors. None takes the task's.
        fields: Other arguments of `tasks.interfaces.vector.VectorTask`, or of
            `tasks.interfaces.device.DeviceTask`.

    Raises:
        MissingPackageError: If the simulator's package is not installed.
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
        SimulationError: If there is no such device, or it has too little memory.
        AssetError: If robot files cannot be found.
        VectorWorkerError: If a worker ends before it is ready.
    """
    if simulator == "mujoco_warp":
        from tasks.interfaces.device import DeviceTask

        return DeviceTask(task_id, num_envs, **fields)
    from tasks.interfaces.vector import VectorTask

    given = {} if simulator is None else {"simulator": simulator}
    return VectorTask(task_id, num_envs, **given, **fields)


def parallel_env(
    task_id: str, robot_reward: Callable[..., float] | None = None, **fields: Any
) -> ParallelTask:
    """Make a PettingZoo ``ParallelEnv`` of a task: one agent per robot, named as its place.

    Args:
        task_id: The task's id or another of its names.
        robot_reward: What each robot earns; None gives every robot the task's reward. Called as
            ``robot_reward(robot, observation, reward, info)`` with its place, what it observes
            now, the task's reward and the info of the step.
        fields: Other arguments of `tasks.make`; ``num_envs`` is not offered.

    Raises:
        MissingPackageError: If pettingzoo is not installed.
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
    """
    optional("pettingzoo", "parallel_env needs pettingzoo", "pettingzoo")
    from tasks.interfaces.parallel import ParallelTask

    return ParallelTask(task_id, robot_reward, **fields)


def sb3_vec_env(
    task_id: str, num_envs: int = 1, num_workers: int | None = None, **fields: Any
) -> SB3Task:
    """Make a Stable-Baselines3 ``VecEnv`` of a task, with the environments of its vector.

    Policies learn from a flat state, ``"MlpPolicy"``, or from named parts of one and from images,
    ``"MultiInputPolicy"`` with ``obs_mode="state_dict"`` or ``"rgb"``. Workers have one thread
    each; those of this process stay torch's (``torch.set_num_threads``).

    Args:
        task_id: The task's id or another of its names.
        num_envs: Number of environments.
        num_workers: Number of processes; None takes one per core, 0 this process.
        fields: ``ignore_terminations``, ``timeout`` and ``render_mode``, as
            ``gymnasium.make_vec`` takes them, and other arguments of `tasks.make`.

    Raises:
        MissingPackageError: If stable-baselines3 is not installed.
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
        AssetError: If robot files cannot be found.
        VectorWorkerError: If a worker ends before it is ready.
    """
    optional("stable_baselines3", "sb3_vec_env needs stable-baselines3", "sb3")
    from tasks.interfaces.sb3 import SB3Task

    return SB3Task(task_id, num_envs, num_workers=num_workers, **fields)


def lerobot_vec_env(
    task_id: str, num_envs: int = 1, num_workers: int | None = None, **fields: Any
) -> LeRobotTask:
    """Make a vector of a task as ``lerobot-eval`` and LeRobot's EnvHub use them.

    What is observed are the columns of exported LeRobot datasets, so that a policy that was trained
    on one plays as it is; LeRobot itself is not needed here.

    Args:
        task_id: The task's id or another of its names.
        num_envs: Number of environments.
        num_workers: Number of processes; None takes one per core, 0 this process.
        fields: ``obs_mode``, one of ``"lerobot"``, ``"lerobot+video"`` and ``"lerobot+cameras"``;
            ``instruction``, what policies are asked to do if it is not the task's own sentence;
            ``timeout`` and ``render_mode``, as ``gymnasium.make_vec`` takes them; and other
            arguments of `tasks.make`.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
        AssetError: If robot files cannot be found.
        VectorWorkerError: If a worker ends before it is ready.
    """
    from tasks.interfaces.lerobot import LeRobotTask

    return LeRobotTask(task_id, num_envs, num_workers=num_workers, **fields)


NAMESPACE = "RobotLayouts"  # Gymnasium ids are RobotLayouts/PickCube-v1


class TaskSpec(EnvSpec):
    """An entry of Gymnasium's registry that knows how long a task's episodes are.

    It asks the task's class, and only when it is asked itself: importing `tasks` loads no task.
    """

    def _steps(self) -> int:
        """Return what was set, or given to `gymnasium.make_vec`, or the task's own."""
        known = self._set_steps or self.kwargs.get("max_episode_steps")
        return known or get_task_class(self.id.rpartition("/")[2]).max_episode_steps

    def _set(self, steps: int | None) -> None:
        self._set_steps = steps

    max_episode_steps = property(_steps, _set)  # pyright: ignore[reportAssignmentType]
