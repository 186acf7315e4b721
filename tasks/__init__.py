"""What is to be achieved: one file per task, a registry, the batched task class, and its fronts.

Nothing is loaded before it is asked for: Gymnasium looks in here whenever it is imported.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tasks.fronts import parallel_env
    from tasks.randomness import EpisodeRandom
    from tasks.registry import get_task_class, list_tasks, make, register_task
    from tasks.scenario import Scenario
    from tasks.task import MultiRobotTask

__all__ = [
    "EpisodeRandom",
    "MultiRobotTask",
    "Scenario",
    "get_task_class",
    "list_tasks",
    "make",
    "parallel_env",
    "register_task",
]

_MODULES = {
    "EpisodeRandom": "tasks.randomness",
    "MultiRobotTask": "tasks.task",
    "Scenario": "tasks.scenario",
    "get_task_class": "tasks.registry",
    "list_tasks": "tasks.registry",
    "make": "tasks.registry",
    "parallel_env": "tasks.fronts",
    "register_task": "tasks.registry",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for, once."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value
