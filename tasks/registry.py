"""Which tasks there are, by id, and how they are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from layouts import Layout, Placement
from layouts.placement import RobotLike, load_robot
from robots import RobotDescriptor, TaskError, UnknownNameError
from robots.common.bounds import shown

if TYPE_CHECKING:
    from tasks.engine.scenario import Scenario
    from tasks.engine.task import MultiRobotTask

# Beginning of the name of a task that clones one of ManiSkill's.
CLONE_PREFIX = "maniskill."

# One line per task, sorted by id: id -> module:class, then its other names.
CATALOGUE = {
    "DrawTriangle-v1": (
        "tasks.maniskill.draw_triangle:DrawTriangle",
        "maniskill.draw_triangle_native",
    ),
    "FourRobotStack-v1": ("tasks.originals.four_robot_stack:FourRobotStack",),
    "LiftPegUpright-v1": (
        "tasks.maniskill.lift_peg_upright:LiftPegUpright",
        "maniskill.lift_peg_upright_native",
    ),
    "PegInsertionSide-v1": (
        "tasks.maniskill.peg_insertion_side:PegInsertionSide",
        "maniskill.peg_insertion_side_native",
    ),
    "PickCube-v1": ("tasks.maniskill.pick_cube:PickCube", "maniskill.pick_cube_native"),
    "PickCubeSO100-v1": (
        "tasks.maniskill.pick_cube_so100:PickCubeSO100",
        "maniskill.pick_cube_so100_native",
    ),
    "PlaceSphere-v1": ("tasks.maniskill.place_sphere:PlaceSphere", "maniskill.place_sphere_native"),
    "PlugCharger-v1": ("tasks.maniskill.plug_charger:PlugCharger", "maniskill.plug_charger_native"),
    "PokeCube-v1": ("tasks.maniskill.poke_cube:PokeCube", "maniskill.poke_cube_native"),
    "PullCube-v1": ("tasks.maniskill.pull_cube:PullCube", "maniskill.pull_cube_native"),
    "PullCubeTool-v1": (
        "tasks.maniskill.pull_cube_tool:PullCubeTool",
        "maniskill.pull_cube_tool_native",
    ),
    "PushCube-v1": ("tasks.maniskill.push_cube:PushCube", "maniskill.push_cube_native"),
    "PushT-v1": ("tasks.maniskill.push_t:PushT", "maniskill.push_t_native"),
    "Relay-v1": ("tasks.originals.relay:Relay",),
    "RollBall-v1": ("tasks.maniskill.roll_ball:RollBall", "maniskill.roll_ball_native"),
    "StackCube-v1": ("tasks.maniskill.stack_cube:StackCube", "maniskill.stack_cube_native"),
    "StackPyramid-v1": (
        "tasks.maniskill.stack_pyramid:StackPyramid",
        "maniskill.stack_pyramid_native",
    ),
    "TwoRobotLiftBar-v1": ("tasks.originals.two_robot_lift_bar:TwoRobotLiftBar",),
    "TwoRobotPickCube-v1": (
        "tasks.maniskill.two_robot_pick_cube:TwoRobotPickCube",
        "maniskill.two_robot_pick_cube_native",
    ),
    "TwoRobotPushPick-v1": ("tasks.originals.two_robot_push_pick:TwoRobotPushPick",),
    "TwoRobotStackCube-v1": (
        "tasks.maniskill.two_robot_stack_cube:TwoRobotStackCube",
        "maniskill.two_robot_stack_cube_native",
    ),
}

_registered: dict[str, type[MultiRobotTask]] = {}  # lower-case name -> class
_listed: list[str] = []  # first name of each registered task

TaskClass = TypeVar("TaskClass", bound="type[MultiRobotTask]")


def register_task(*names: str) -> Callable[[TaskClass], TaskClass]:
    """Make a task class known by names; the first one is its id. For use as a decorator.

    A name that begins with ``maniskill.`` says that it clones ManiSkill's task of that id.

    Raises:
        TaskError: If no name is given or a name is taken by another class.
    """
    if not names or not all(isinstance(name, str) and name for name in names):
        raise TaskError(
            "register_task needs at least one name, the task's id, and takes nothing but names;"
            f" given: {shown(names)}"
        )

    def register(cls: TaskClass) -> TaskClass:
        for name in names:
            registered = _registered.get(name.lower())
            owner = _built_in(name) if registered is None else _home(registered)
            if owner not in (None, _home(cls)):
                raise TaskError(f"the name {name!r} is already taken by {owner}")
        _registered.update({name.lower(): cls for name in names})
        if names[0] not in _listed and names[0] not in CATALOGUE:
            _listed.append(names[0])
            import_module("tasks.fronts").register()
        cls.task_id = names[0]
        cls.native_id = names[0] if any(map(_is_clone_name, names)) else None
        return cls

    return register


def list_tasks() -> tuple[str, ...]:
    """Return every task id, sorted."""
    return tuple(sorted({*CATALOGUE, *_listed}))


def list_clones() -> tuple[str, ...]:
    """Return the id of every task that clones one of ManiSkill's, sorted."""
    built_in = (i for i, (_, *names) in CATALOGUE.items() if any(map(_is_clone_name, names)))
    registered = (i for i in _listed if _registered[i.lower()].native_id is not None)
    return tuple(sorted({*built_in, *registered}))


def get_task_class(name: str) -> type[MultiRobotTask]:
    """Return the class of a task by id or other name, ignoring case.

    ``pick_cube`` is short for ``maniskill.pick_cube_native``.

    Raises:
        UnknownNameError: If no task has that name (also a ``KeyError``).
    """
    for key in (str(name).lower(), f"{CLONE_PREFIX}{str(name).lower()}_native"):
        if key not in _registered and (target := _built_in(key)):
            import_module(target.partition(":")[0])  # registers itself
        if key in _registered:
            return _registered[key]
    raise UnknownNameError("task", name, _all_names())


def other_names(cls: type[MultiRobotTask]) -> tuple[str, ...]:
    """Return what a task class is known as besides its id, in lower case."""
    return tuple(n for n, c in _registered.items() if c is cls and n != cls.task_id.lower())


def make(
    task_id: str,
    num_envs: int = 1,
    robots: RobotLike | Mapping[str, RobotLike] | None = None,
    layout: Layout | None = None,
    obs_mode: str = "state",
    reward_mode: str | None = None,
    **fields: Any,
) -> MultiRobotTask:
    """Make a task.

    Args:
        task_id: Its id or another of its names.
        num_envs: Number of environments in this process.
        robots: Other robots for some places: a mapping place → robot, or one robot for a task
            with one place. A robot that lacks its place's keyframe starts from its home's.
        layout: Another layout with the task's places, in any order; for a task over any number of
            robots, with places of any names.
        obs_mode: ``"state"``, ``"state_dict"``, ``"none"``, or what cameras see: ``"rgb"``,
            ``"rgbd"`` and others; see `tasks.Scenario`.
        reward_mode: One of the task's reward modes; None takes native's default.
        fields: Other fields of `tasks.Scenario`.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
        LayoutError: If the robots of another layout collide, and ``check_layout`` is not False.
        AssetError: If robot files cannot be found.
    """
    cls = get_task_class(task_id)
    return cls(make_scenario(cls, num_envs, robots, layout, obs_mode, reward_mode, **fields))


def make_scenario(
    cls: type[MultiRobotTask],
    num_envs: int = 1,
    robots: RobotLike | Mapping[str, RobotLike] | None = None,
    layout: Layout | None = None,
    obs_mode: str = "state",
    reward_mode: str | None = None,
    **fields: Any,
) -> Scenario:
    """Return the scenario that `make` makes a task of, for the same arguments.

    Raises:
        UnknownNameError: If a place, a robot or a field is unknown.
        TaskError: If the robots do not say which places they take.
    """
    scenario = cls.scenario
    if layout is not None:
        if not isinstance(layout, Layout):
            raise TaskError(f"layout is {shown(layout)}; a layouts.Layout is needed")
        scenario.layout = layout
    if robots is not None:
        scenario.layout = _replace_robots(scenario.layout, robots)
    chosen = {"num_envs": num_envs, "obs_mode": obs_mode, "reward_mode": reward_mode, **fields}
    for name, value in chosen.items():
        setattr(scenario, name, value)
    return scenario


def _replace_robots(layout: Layout, robots: RobotLike | Mapping[str, RobotLike]) -> Layout:
    if isinstance(robots, Mapping):
        changed = {place: _stand(layout[place], robot) for place, robot in robots.items()}
        return Layout({**layout, **changed}, layout.frames)
    if len(layout) == 1 and isinstance(robots, (str, RobotDescriptor)):
        return _replace_robots(layout, {next(iter(layout)): robots})
    given = [robots] if isinstance(robots, (str, RobotDescriptor)) else robots
    names = [name for name in given if isinstance(name, str)] if isinstance(given, list) else []
    example = dict(zip(layout, names or ["panda"], strict=False))
    raise TaskError(
        f"robots={shown(robots)} does not say which place each robot takes; the places are"
        f" {list(layout)}, for example robots={example}"
    )


def _stand(placement: Placement, robot: RobotLike) -> Placement:
    """Return a placement with another robot, at its home's keyframe if it lacks the place's."""
    robot = load_robot(robot)
    if placement.keyframe not in robot.keyframes:
        placement = replace(placement, keyframe=None)
    return placement.with_robot(robot)


def _is_clone_name(name: str) -> bool:
    return name.lower().startswith(CLONE_PREFIX)


def _built_in(name: str) -> str | None:
    for task_id, (target, *others) in CATALOGUE.items():
        if str(name).lower() in (task_id.lower(), *(other.lower() for other in others)):
            return target
    return None


def _home(cls: type) -> str:
    return f"{cls.__module__}:{cls.__qualname__}"


def _all_names() -> list[str]:
    others = [name for _, *names in CATALOGUE.values() for name in names]
    registered = [name for name in _registered if name not in map(str.lower, [*CATALOGUE, *others])]
    listed = [name for name in _listed if name.lower() in registered]
    rest = [name for name in registered if name not in map(str.lower, listed)]
    return [*CATALOGUE, *others, *listed, *rest]
