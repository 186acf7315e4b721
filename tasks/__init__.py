"""What is to be achieved: tasks for one robot or many, and the interfaces they are used by.

Making a task:
    make: A task by its id, ``tasks.make("PickCube-v1", num_envs=4)``; stepped as a batch.
    list_tasks, list_clones: The ids there are; those that clone one of ManiSkill's tasks.
    get_task_class: The class behind an id.
    Scenario: Everything a task is made with; ``cls.scenario`` is one to start from.

Making an environment of it for other programs (each loads its package when it is called):
    gymnasium.make, gymnasium.make_vec: ``"RobotLayouts/PickCube-v1"``, once this is imported.
    parallel_env: PettingZoo, one agent per robot.
    sb3_vec_env: Stable-Baselines3.

Writing a task:
    MultiRobotTask: What a task's class subclasses.
    register_task: Gives it its names.
    EpisodeRandom: The random streams that it draws from.

``python -m tasks list`` prints a table of all tasks. Importing this loads neither torch nor sapien.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tasks.fronts import parallel_env, register, sb3_vec_env

if TYPE_CHECKING:
    from tasks.engine.randomness import EpisodeRandom
    from tasks.engine.scenario import Scenario
    from tasks.engine.task import MultiRobotTask
    from tasks.registry import get_task_class, list_clones, list_tasks, make, register_task

__all__ = [
    "EpisodeRandom",
    "MultiRobotTask",
    "Scenario",
    "get_task_class",
    "list_clones",
    "list_tasks",
    "make",
    "parallel_env",
    "register_task",
    "sb3_vec_env",
]

_MODULES = {
    "EpisodeRandom": "tasks.engine.randomness",
    "MultiRobotTask": "tasks.engine.task",
    "Scenario": "tasks.engine.scenario",
    "get_task_class": "tasks.registry",
    "list_clones": "tasks.registry",
    "list_tasks": "tasks.registry",
    "make": "tasks.registry",
    "register_task": "tasks.registry",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for, once."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    """List what is loaded only when it is asked for, too: `help` and completion go by this."""
    return sorted({*globals(), *__all__})


register()
