"""Robots, layouts and tasks under one name: ``import robot_layouts as rl``.

What a robot is:
    RobotRegistry, RobotDescriptor: Robots by name; from a URDF, `RobotDescriptor.from_urdf`.

What a thing is:
    ObjectRegistry: Mugs, pots, tools and parts by name.

Who stands where:
    Layout, Placement, single, side_by_side, face_to_face, ring, around_table, grid: A layout.
    search: Places from which robots reach what they are to reach.

What is to be achieved:
    make, list_tasks, get_task_class: Environments of a task by its id.
    MultiRobotTask, TaskEnv, register_task, Randomization: A task of your own.

How robots move:
    plan, Motion, TcpGoal, RegionGoal: Motions that do not collide.
    find_expert, register_expert: Scripts that solve tasks.

What happened:
    record, evaluate, Evaluation: Episodes that an expert or a policy plays.
    Recording: What was recorded.
    view: A layout, an environment or a recording, in a browser.
    Receipt, verify: Scores that anyone can play again.

Importing this loads none of it: each name is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from robot_layouts.core.errors import missing_name

if TYPE_CHECKING:
    from layouts import (
        Layout,
        Placement,
        around_table,
        face_to_face,
        grid,
        ring,
        search,
        side_by_side,
        single,
    )
    from objects import ObjectRegistry
    from robot_layouts.data import Evaluation, evaluate, record, view
    from robot_layouts.data.reading.recording import Recording
    from robot_layouts.data.receipts import Receipt, verify
    from robot_layouts.experts import find_expert, register_expert
    from robot_layouts.motion import Motion, RegionGoal, TcpGoal, plan
    from robots import RobotDescriptor, RobotLayoutsError, RobotRegistry
    from tasks import (
        MultiRobotTask,
        Randomization,
        TaskEnv,
        get_task_class,
        list_tasks,
        make,
        register_task,
    )

__all__ = [
    "Evaluation",
    "Layout",
    "Motion",
    "MultiRobotTask",
    "ObjectRegistry",
    "Placement",
    "Randomization",
    "Receipt",
    "Recording",
    "RegionGoal",
    "RobotDescriptor",
    "RobotLayoutsError",
    "RobotRegistry",
    "TaskEnv",
    "TcpGoal",
    "around_table",
    "evaluate",
    "face_to_face",
    "find_expert",
    "get_task_class",
    "grid",
    "list_tasks",
    "make",
    "plan",
    "record",
    "register_expert",
    "register_task",
    "ring",
    "search",
    "side_by_side",
    "single",
    "verify",
    "view",
]

_HOMES = {
    "robots": ("RobotDescriptor", "RobotLayoutsError", "RobotRegistry"),
    "objects": ("ObjectRegistry",),
    "layouts": (
        *("Layout", "Placement", "around_table", "face_to_face", "grid", "ring", "search"),
        *("side_by_side", "single"),
    ),
    "tasks": (
        *("MultiRobotTask", "Randomization", "TaskEnv", "get_task_class", "list_tasks", "make"),
        "register_task",
    ),
    "robot_layouts.motion": ("Motion", "RegionGoal", "TcpGoal", "plan"),
    "robot_layouts.experts": ("find_expert", "register_expert"),
    "robot_layouts.data": ("Evaluation", "evaluate", "record", "view"),
    "robot_layouts.data.reading.recording": ("Recording",),
    "robot_layouts.data.receipts": ("Receipt", "verify"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for."""
    home = next((home for home, names in _HOMES.items() if name in names), None)
    if home is None:
        raise missing_name(__name__, name, __all__)
    value = globals()[name] = getattr(import_module(home), name)
    return value


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
