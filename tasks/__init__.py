"""What is to be achieved: one file per task, a registry, the batched task class, and its fronts.

Importing this tells Gymnasium the tasks. What needs torch or sapien is loaded when it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tasks.fronts import parallel_env, register, sb3_vec_env

if TYPE_CHECKING:
    from tasks.randomness import EpisodeRandom
    from tasks.registry import get_task_class, list_clones, list_tasks, make, register_task
    from tasks.scenario import Scenario
    from tasks.task import MultiRobotTask

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
    "EpisodeRandom": "tasks.randomness",
    "MultiRobotTask": "tasks.task",
    "Scenario": "tasks.scenario",
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


register()
