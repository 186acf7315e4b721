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
    lerobot_vec_env: LeRobot's evaluation.

Writing a task (`tasks.vocabulary` lists every name; functions of arrays are in `tasks.maths`):
    MultiRobotTask: What a task's class subclasses.
    register_task: Gives it its names.
    Needs: What a place needs of the robot that stands there.
    Cube, Goal, Table, Area, …: Bodies that it declares, and where they begin.
    State, World, EpisodeRandom: What its methods are given.
    closeness, stillness, lies_on, …: Terms of rewards and of success.

``robot-layouts tasks list`` prints them as a table. Importing this loads neither torch nor sapien.
"""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "simulation")

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tasks.fronts import lerobot_vec_env, parallel_env, register, sb3_vec_env
from tasks.registry import on_registration

if TYPE_CHECKING:
    from tasks.registry import get_task_class, list_clones, list_tasks, make
    from tasks.vocabulary import *  # noqa: F403
    from tasks.vocabulary import EpisodeRandom, MultiRobotTask, Scenario, register_task

_REGISTRY = ("get_task_class", "list_clones", "list_tasks", "make", "register_task")

__all__ = [  # what only tasks' files need is in `tasks.vocabulary`
    "EpisodeRandom",
    "MultiRobotTask",
    "Scenario",
    "get_task_class",
    "lerobot_vec_env",
    "list_clones",
    "list_tasks",
    "make",
    "parallel_env",
    "register_task",
    "sb3_vec_env",
]


def __getattr__(name: str) -> Any:
    """Load what is asked for, once."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = import_module("tasks.registry" if name in _REGISTRY else "tasks.vocabulary")
    if name not in (*_REGISTRY, *getattr(home, "__all__", ())):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(home, name)
    return value


def __dir__() -> list[str]:
    """List what is loaded only when it is asked for, too: `help` and completion go by this."""
    return sorted({*globals(), *__all__})


on_registration(register)
