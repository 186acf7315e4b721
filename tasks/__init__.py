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

Writing a task (functions of arrays are in `tasks.maths`):
    MultiRobotTask: What a task's class subclasses.
    CellTask: One in stages, on a table; says what is seen and rewarded unless told otherwise.
    TaskEnv: What `make` returns: environments that step a task.
    register_task: Gives it its names.
    Needs: What a place needs of the robot that stands there.
    Fit: How its places and sizes suit the robots that it is made with, if it ``fits_robots``.
    Cube, Object, Table, Area, …: Bodies that it declares, and where they begin.
    State, World, EpisodeRandom: What its methods are given.
    closeness, stillness, lies_on, …: Terms of rewards and of success.

``robot-layouts tasks list`` prints them as a table. Importing this loads neither torch nor sapien.
"""

from robot_layouts.core.own_packages import expect_own

expect_own("robots", "objects", "layouts")

from importlib import import_module
from typing import TYPE_CHECKING, Any

from robot_layouts.core.errors import missing_name
from tasks.interfaces import lerobot_vec_env, parallel_env, register, sb3_vec_env
from tasks.registry import get_task_class, list_clones, list_tasks, make, on_registration

if TYPE_CHECKING:
    from tasks.vocabulary import *  # noqa: F403

__all__ = [  # those of `tasks.vocabulary` as well, which is loaded when one of them is asked for
    "BLUE",
    "DARK_BLUE",
    "DARK_RED",
    "FACE_UP",
    "GREEN",
    "POLISHED",
    "RED",
    "TARGET_HEIGHT",
    "WHITE",
    "Area",
    "Ball",
    "Box",
    "Camera",
    "CameraShift",
    "Capsule",
    "CellTask",
    "Choice",
    "Color",
    "Compound",
    "ConvexHull",
    "Cube",
    "Cuboid",
    "Cylinder",
    "Distractors",
    "EpisodeRandom",
    "Finish",
    "Fit",
    "Fixed",
    "Friction",
    "Goal",
    "Ground",
    "Info",
    "Joint",
    "KitchenCounter",
    "Light",
    "LogUniform",
    "Mesh",
    "MultiRobotTask",
    "TaskEnv",
    "Needs",
    "Normal",
    "Object",
    "Peg",
    "PhysicsSettings",
    "Plane",
    "Quaternion",
    "Randomization",
    "Scenario",
    "Surroundings",
    "Shape",
    "Shift",
    "Sphere",
    "State",
    "Surface",
    "Table",
    "Target",
    "Texture",
    "Uniform",
    "Vector3",
    "Whole",
    "WideTable",
    "World",
    "add_goal",
    "add_ground",
    "add_object",
    "add_table",
    "add_target",
    "add_wide_table",
    "angle_between",
    "closeness",
    "compose",
    "diagonal",
    "distance_to_top",
    "get_task_class",
    "inverse",
    "is_at_rest",
    "lerobot_vec_env",
    "letting_go",
    "lies_on",
    "linear",
    "list_clones",
    "list_tasks",
    "make",
    "once_per_state",
    "parallel_env",
    "register_task",
    "sb3_vec_env",
    "stillness",
    "transform",
]


def __getattr__(name: str) -> Any:
    """Load what is asked for, once."""
    if name not in __all__:
        raise missing_name(__name__, name, __all__)
    value = globals()[name] = getattr(import_module("tasks.vocabulary"), name)
    return value


def __dir__() -> list[str]:
    """List what is public, loaded or not: `help` and completion go by this."""
    return __all__


on_registration(register)
