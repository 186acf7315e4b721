"""What is to be achieved: one file per task, a registry, and the batched task class."""

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
    "register_task",
]
