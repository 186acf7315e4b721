"""Which tasks there are, by id, and how they are made."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields as fields_of
from dataclasses import replace
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeVar

from layouts import Layout, Placement, at_task
from layouts.frames import ORIGIN
from layouts.placement import RobotLike, load_robot
from layouts.standing import held_widths, needed_reaches
from robot_layouts.core.bounds import shown
from robot_layouts.core.catalogue import Catalogue, reason
from robots import RobotDescriptor, RobotLayoutsError, TaskError, UnknownNameError, closest_match

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tasks.engine.env import MultiRobotTask, TaskEnv
    from tasks.engine.scenario import MakingFields, Scenario, ScenarioFields

CLONES = "tasks.maniskill."  # where the tasks that clone one of ManiSkill's are

# One line per task, sorted by id: id -> module:class.
CATALOGUE = {
    "CellBalanceBall-v1": "tasks.cells.balance_ball:CellBalanceBall",
    "CellBuildBridge-v1": "tasks.cells.build_bridge:CellBuildBridge",
    "CellBuildGate-v1": "tasks.cells.build_gate:CellBuildGate",
    "CellCarryBeam-v1": "tasks.cells.carry_beam:CellCarryBeam",
    "CellCloseDrawers-v1": "tasks.cells.close_drawers:CellCloseDrawers",
    "CellCrossOver-v1": "tasks.cells.cross_over:CellCrossOver",
    "CellFillDrawer-v1": "tasks.cells.fill_drawer:CellFillDrawer",
    "CellFillHeldBin-v1": "tasks.cells.fill_held_bin:CellFillHeldBin",
    "CellGatherBlocks-v1": "tasks.cells.gather_blocks:CellGatherBlocks",
    "CellHammerPegs-v1": "tasks.cells.hammer_pegs:CellHammerPegs",
    "CellHandMugOn-v1": "tasks.cells.hand_mug_on:CellHandMugOn",
    "CellHangBrackets-v1": "tasks.cells.hang_brackets:CellHangBrackets",
    "CellHoldAndPush-v1": "tasks.cells.hold_and_push:CellHoldAndPush",
    "CellHoldGate-v1": "tasks.cells.hold_gate:CellHoldGate",
    "CellInsertPegs-v1": "tasks.cells.insert_pegs:CellInsertPegs",
    "CellLiftBoard-v1": "tasks.cells.lift_board:CellLiftBoard",
    "CellLiftPot-v1": "tasks.cells.lift_pot:CellLiftPot",
    "CellLoadTray-v1": "tasks.cells.load_tray:CellLoadTray",
    "CellMountGears-v1": "tasks.cells.mount_gears:CellMountGears",
    "CellMovePot-v1": "tasks.cells.move_pot:CellMovePot",
    "CellOpenBox-v1": "tasks.cells.open_box:CellOpenBox",
    "CellPackKit-v1": "tasks.cells.pack_kit:CellPackKit",
    "CellPackTote-v1": "tasks.cells.pack_tote:CellPackTote",
    "CellPassAround-v1": "tasks.cells.pass_around:CellPassAround",
    "CellPassGlass-v1": "tasks.cells.pass_glass:CellPassGlass",
    "CellPressInOrder-v1": "tasks.cells.press_in_order:CellPressInOrder",
    "CellPressTogether-v1": "tasks.cells.press_together:CellPressTogether",
    "CellPushBar-v1": "tasks.cells.push_bar:CellPushBar",
    "CellPutAndClose-v1": "tasks.cells.put_and_close:CellPutAndClose",
    "CellPutAway-v1": "tasks.cells.put_away:CellPutAway",
    "CellRaiseFrame-v1": "tasks.cells.raise_frame:CellRaiseFrame",
    "CellRakeAndPlace-v1": "tasks.cells.rake_and_place:CellRakeAndPlace",
    "CellRelay-v1": "tasks.cells.relay:CellRelay",
    "CellRunPlant-v1": "tasks.cells.run_plant:CellRunPlant",
    "CellServe-v1": "tasks.cells.serve:CellServe",
    "CellSetFaders-v1": "tasks.cells.set_faders:CellSetFaders",
    "CellShiftRing-v1": "tasks.cells.shift_ring:CellShiftRing",
    "CellShutSuitcase-v1": "tasks.cells.shut_suitcase:CellShutSuitcase",
    "CellSortByWord-v1": "tasks.cells.sort_by_word:CellSortByWord",
    "CellSortCubes-v1": "tasks.cells.sort_cubes:CellSortCubes",
    "CellSqueezeBox-v1": "tasks.cells.squeeze_box:CellSqueezeBox",
    "CellStackInOrder-v1": "tasks.cells.stack_in_order:CellStackInOrder",
    "CellStowTwo-v1": "tasks.cells.stow_two:CellStowTwo",
    "CellSwapPlaces-v1": "tasks.cells.swap_places:CellSwapPlaces",
    "CellSweepBlocks-v1": "tasks.cells.sweep_blocks:CellSweepBlocks",
    "CellTakeSides-v1": "tasks.cells.take_sides:CellTakeSides",
    "CellThrowLevers-v1": "tasks.cells.throw_levers:CellThrowLevers",
    "CellTurnTaps-v1": "tasks.cells.turn_taps:CellTurnTaps",
    "CellTwoHandPress-v1": "tasks.cells.two_hand_press:CellTwoHandPress",
    "CellUnloadTurntable-v1": "tasks.cells.unload_turntable:CellUnloadTurntable",
    "CellUnlock-v1": "tasks.cells.unlock:CellUnlock",
    "DrawTriangle-v1": "tasks.maniskill.draw_triangle:DrawTriangle",
    "FMBAssembly1Easy-v1": "tasks.maniskill.fmb_assembly:FMBAssembly1Easy",
    "FourRobotStack-v1": "tasks.originals.four_robot_stack:FourRobotStack",
    "LiftPegUpright-v1": "tasks.maniskill.lift_peg_upright:LiftPegUpright",
    "PegInsertionSide-v1": "tasks.maniskill.peg_insertion_side:PegInsertionSide",
    "PickCube-v1": "tasks.maniskill.pick_cube:PickCube",
    "PickCubeSO100-v1": "tasks.maniskill.pick_cube_so100:PickCubeSO100",
    "PlaceSphere-v1": "tasks.maniskill.place_sphere:PlaceSphere",
    "PlugCharger-v1": "tasks.maniskill.plug_charger:PlugCharger",
    "PokeCube-v1": "tasks.maniskill.poke_cube:PokeCube",
    "PullCube-v1": "tasks.maniskill.pull_cube:PullCube",
    "PullCubeTool-v1": "tasks.maniskill.pull_cube_tool:PullCubeTool",
    "PushCube-v1": "tasks.maniskill.push_cube:PushCube",
    "PushT-v1": "tasks.maniskill.push_t:PushT",
    "Relay-v1": "tasks.originals.relay:Relay",
    "RollBall-v1": "tasks.maniskill.roll_ball:RollBall",
    "RotateValveLevel0-v1": "tasks.maniskill.rotate_valve:RotateValveLevel0",
    "RotateValveLevel1-v1": "tasks.maniskill.rotate_valve:RotateValveLevel1",
    "RotateValveLevel2-v1": "tasks.maniskill.rotate_valve:RotateValveLevel2",
    "RotateValveLevel3-v1": "tasks.maniskill.rotate_valve:RotateValveLevel3",
    "RotateValveLevel4-v1": "tasks.maniskill.rotate_valve:RotateValveLevel4",
    "StackCube-v1": "tasks.maniskill.stack_cube:StackCube",
    "StackPyramid-v1": "tasks.maniskill.stack_pyramid:StackPyramid",
    "TableTopFreeDraw-v1": "tasks.maniskill.table_top_free_draw:TableTopFreeDraw",
    "TwoRobotHandOver-v1": "tasks.originals.two_robot_hand_over:TwoRobotHandOver",
    "TwoRobotLiftBar-v1": "tasks.originals.two_robot_lift_bar:TwoRobotLiftBar",
    "TwoRobotPickCube-v1": "tasks.maniskill.two_robot_pick_cube:TwoRobotPickCube",
    "TwoRobotPushPick-v1": "tasks.originals.two_robot_push_pick:TwoRobotPushPick",
    "TwoRobotStackCube-v1": "tasks.maniskill.two_robot_stack_cube:TwoRobotStackCube",
    "UnitreeG1PlaceAppleInBowl-v1": (
        "tasks.maniskill.unitree_g1_place_apple_in_bowl:UnitreeG1PlaceAppleInBowl"
    ),
    "UnitreeG1TransportBox-v1": ("tasks.maniskill.unitree_g1_transport_box:UnitreeG1TransportBox"),
}

TaskClass = TypeVar("TaskClass", bound="type[MultiRobotTask]")

_listeners: list[Callable[[Iterable[str]], None]] = []


_WORD_ENDS = re.compile("(?<=[a-z])(?=[A-Z])")


def _native_name(name: str) -> str:
    return f"maniskill.{name}_native"


def _check(given: object, origin: str, name: str) -> type[MultiRobotTask]:
    """Return what an entry point gave, if it is a task's class of the name that it goes by."""
    from tasks.engine.env import MultiRobotTask

    if not (isinstance(given, type) and issubclass(given, MultiRobotTask) and given.task_id):
        raise TaskError(
            f"{origin} gave {shown(given)}; a subclass of tasks.MultiRobotTask is needed, with"
            f" @register_task({name!r}) above it"
        )
    if given.task_id.lower() != name.lower():
        raise TaskError(f"{origin} is listed as {name!r}, but its task is {given.task_id!r}")
    return given


TASKS = Catalogue(
    "task",
    CATALOGUE,
    group="robot_layouts.tasks",
    check=_check,
    error=TaskError,
    aliases={
        _native_name(_WORD_ENDS.sub("_", task_id.partition("-v")[0]).lower()): task_id
        for task_id, target in CATALOGUE.items()
        if target.startswith(CLONES)
    }
    | {"pick_cube_native": "PickCube-v1"},  # as RoboVerse has it, too
    ignore_case=True,
    hint="`robot-layouts tasks list` has all. A task of your own goes by 'module:Id', as in"
    " 'mylab.tray:TwoArmTray-v1', and is registered there by @register_task('Id').",
)


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
        from tasks.engine.declared import check_declaration  # it loads torch, as the class has
        from tasks.engine.env import MultiRobotTask

        if not (isinstance(cls, type) and issubclass(cls, MultiRobotTask)):
            raise TaskError(
                f"@register_task({names[0]!r}) is above {shown(cls)}; it takes a subclass of"
                " tasks.MultiRobotTask"
            )
        check_declaration(cls)
        for name in names:
            if (owner := TASKS.home(name)) not in (None, f"{cls.__module__}:{cls.__qualname__}"):
                raise TaskError(f"the name {name!r} is already taken by {owner}")
        cls.task_id = names[0]
        cls.native_id = names[0] if any(map(_is_native_name, names)) else None
        TASKS.register(names[0], cls, names[1:])
        for listener in _listeners:
            listener(names[:1])
        return cls

    return register


def on_registration(listener: Callable[[Iterable[str]], None]) -> None:
    """Call a function with every task id now, and with each that is registered later."""
    _listeners.append(listener)
    listener(list_tasks())


def list_tasks() -> tuple[str, ...]:
    """Return every task id, sorted."""
    return tuple(iter(TASKS))  # a mapping's length, too, takes a look at every installed package


def list_own() -> tuple[str, ...]:
    """Return the id of every task that was registered in this process and is not built in."""
    return tuple(sorted(set(TASKS.registered) - set(CATALOGUE)))


def list_clones() -> tuple[str, ...]:
    """Return the id of every task that clones one of ManiSkill's, sorted.

    Of tasks that other packages bring, only those are known that were looked up before.
    """
    native = filter(_is_native_name, TASKS.aliases)
    return tuple(sorted({TASKS.aliases[name] for name in native}))


def get_task_class(name: str) -> type[MultiRobotTask]:
    """Return the class of a task by id or other name, ignoring case.

    ``pick_cube`` is short for ``maniskill.pick_cube_native``. ``mylab.tray:TwoArmTray-v1`` imports
    ``mylab.tray`` and takes the task that is registered there by that id.

    Raises:
        UnknownNameError: If no task has that name (also a ``KeyError``).
        TaskError: If it is in a module that cannot be imported, or in a broken entry point.
    """
    name = str(name)
    module, colon, task_id = name.rpartition(":")
    if colon:
        _import(module, f"of the task {name!r}")
        name = task_id
    for spelling in (name, _native_name(name)):
        if spelling in TASKS:
            return TASKS[spelling]
    raise TASKS.unknown(name, f"Importing {module!r} registered no such task." if colon else None)


def origin(task_id: str) -> str | None:
    """Return the module or the package that a task comes from; None if this library's own."""
    return TASKS.origin(task_id)


def full_name(cls: type[MultiRobotTask]) -> str:
    """Return what finds a class in every process: its id, or ``module:Id`` if it is in no list."""
    outside = TASKS.origin(cls.task_id) == cls.__module__
    return f"{cls.__module__}:{cls.task_id}" if outside else cls.task_id


def load_tasks(module: str) -> None:
    """Import a module of the user's own, which registers the tasks in it.

    Raises:
        TaskError: If it cannot be imported.
    """
    _import(module.partition(":")[0], "of tasks")


def other_names(cls: type[MultiRobotTask]) -> tuple[str, ...]:
    """Return what a task class is known as besides its id, in lower case."""
    return TASKS.aliases_of(cls.task_id)


def make(
    task_id: str,
    num_envs: int = 1,
    robots: RobotLike | Mapping[str, RobotLike] | None = None,
    layout: Layout | None = None,
    obs_mode: str = "state",
    reward_mode: str | None = None,
    **fields: Unpack[ScenarioFields],
) -> TaskEnv:
    """Make a task.

    Args:
        task_id: Its id or another of its names.
        num_envs: Number of environments in this process.
        robots: Other robots for some places: a mapping place → robot, or one robot for all of
            them; by name, descriptor, the path of a URDF or MJCF to guess it from, or
            ``MODULE:NAME``. They stand at the layout's places, or, in a task that fits its robots
            and where neither the layout nor the robot says a place, where `layouts.at_task` puts
            them. One that lacks its place's keyframe starts from its
            home's. One robot of several limbs serves all places, as `layouts.at_task` puts it.
        layout: Another layout with the task's places, in any order; for a task over any number of
            robots, with places of any names. ``bystanders="hold"`` or ``"act"`` lets more robots
            stand there.
        obs_mode: ``"state"``, ``"state_dict"``, ``"none"``, or what cameras see: ``"rgb"``,
            ``"rgbd"`` and others; see `tasks.Scenario`.
        reward_mode: One of the task's reward modes; None takes native's default.
        fields: Other fields of `tasks.Scenario`.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that.
        LayoutError: If the robots of the layout collide, and ``check_layout`` is not False.
        AssetError: If robot files cannot be found.
    """
    cls = get_task_class(task_id)
    scenario = make_scenario(
        cls,
        num_envs,
        robots=robots,
        layout=layout,
        obs_mode=obs_mode,
        reward_mode=reward_mode,
        **fields,
    )
    return cls(scenario)


def make_scenario(
    cls: type[MultiRobotTask], num_envs: int = 1, **making: Unpack[MakingFields]
) -> Scenario:
    """Return the scenario that `make` makes a task of, for the same arguments.

    Raises:
        UnknownNameError: If a place, a robot or a field is unknown; of a field, it is a
            ``TypeError`` as well.
        TaskError: If the robots do not say which places they take.
    """
    scenario = cls.scenario
    known = [*(field.name for field in fields_of(scenario)), "robots"]
    for name in making:
        if name not in known:
            raise UnexpectedArgumentError.of(cls.task_id, name, known)
    layout, robots = making.pop("layout", None), making.pop("robots", None)
    if layout is not None:
        if not isinstance(layout, Layout):
            raise TaskError(f"layout is {shown(layout)}; a layouts.Layout is needed")
        scenario.layout = layout
    if robots is not None:
        scenario.layout = _replace_robots(cls, scenario.layout, robots)
    scenario.num_envs = num_envs
    if isinstance(name := making.get("randomization"), str):
        making["randomization"] = cls.setting(name)
    for name, value in making.items():
        setattr(scenario, name, value)
    return scenario


def scenario_of(
    task: str | TaskEnv, num_envs: int = 1, **making: Unpack[MakingFields]
) -> tuple[type[MultiRobotTask], Scenario]:
    """Return the class of a task, and how to make it: of its name, or as an environment was made.

    Args:
        task: Its id or another of its names, or an environment of it.
        num_envs: Number of environments to make.
        making: Arguments of `make`; none if an environment is given.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that, or an environment is given and arguments.
    """
    from tasks.engine.env import TaskEnv

    if not isinstance(task, TaskEnv):
        cls = get_task_class(task)
        return cls, make_scenario(cls, num_envs, **making)
    if making:
        raise TaskError(
            f"{', '.join(making)} given beside an environment of {task.task_id}, which is played as"
            " it was made; pass them to tasks.make, or give the task's id"
        )
    return task.task_class, replace(task.scenario, num_envs=num_envs)


class UnexpectedArgumentError(UnknownNameError, TypeError):
    """An argument that tasks are not made with (also a ``TypeError``, as Python's own error is).

    Other packages try arguments, and go by that type and Python's words.
    """

    def __init__(self, message: str, name: object = "", choices: Iterable[str] = ()) -> None:
        """Take the whole message: Gymnasium raises errors anew, with a longer one alone."""
        self.kind, self.name, self.choices = "argument", name, tuple(choices)
        RobotLayoutsError.__init__(self, message)

    @classmethod
    def of(cls, task_id: str, name: str, choices: Iterable[str]) -> UnexpectedArgumentError:
        """Return the error of a name, with the closest match and all choices."""
        choices = tuple(choices)
        match = closest_match(name, choices)
        suggestion = f" Did you mean {match!r}?" if match else ""
        return cls(
            f"{task_id} got an unexpected keyword argument {shown(name)}.{suggestion} Choices:"
            f" {', '.join(choices)}.",
            name,
            choices,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by message, so that worker processes can send the error home."""
        return type(self), (self.args[0], self.name, self.choices)


def _replace_robots(
    cls: type[MultiRobotTask], layout: Layout, robots: RobotLike | Mapping[str, RobotLike]
) -> Layout:
    where = cls if layout == cls.layout else layout
    if isinstance(robots, Mapping):
        if cls.robot_counts is None:
            _refuse_bodies(cls, robots)
        if cls.fits() and robots:
            held, needed = held_widths(cls, layout), needed_reaches(cls, layout)
            return at_task(robots, where, holding=held, needed=needed)
        changed = {place: _stand(layout[place], robot) for place, robot in robots.items()}
        lost = {place: at.robot for place, at in changed.items() if _lacks_a_place(at)}
        if lost:
            held, needed = held_widths(cls, layout), needed_reaches(cls, layout)
            placed = at_task(lost, where, holding=held, needed=needed)
            changed |= {place: placed[place] for place in lost}
        return Layout({**layout, **changed}, layout.frames)
    if isinstance(robots, (str, PathLike, RobotDescriptor)):
        if (robot := load_robot(robots)).limbs:
            return at_task(robot, where)
        return _replace_robots(cls, layout, dict.fromkeys(layout, robot))
    names = [name for name in robots if isinstance(name, str)] if isinstance(robots, list) else []
    example = dict(zip(layout, names or ["panda"], strict=False))
    raise TaskError(
        f"robots={shown(robots)} does not say which place each robot takes; the places are"
        f" {list(layout)}, for example robots={example}"
    )


def _refuse_bodies(cls: type[MultiRobotTask], robots: Mapping[str, RobotLike]) -> None:
    """Refuse robots of several limbs in single places.

    Raises:
        TaskError: If there is one.
    """
    for place, robot in ((place, load_robot(robot)) for place, robot in robots.items()):
        if robot.limbs:
            raise TaskError(
                f"{robot.name} has the limbs {', '.join(robot.limbs)}, more than place {place!r}"
                f" takes; robots={robot.name!r} lets them serve all of {cls.task_id}"
            )


def _stand(placement: Placement, robot: RobotLike) -> Placement:
    """Return a placement with another robot, at its home's keyframe if it lacks the place's."""
    robot = load_robot(robot)
    if placement.keyframe not in robot.keyframes:
        placement = replace(placement, keyframe=None)
    return placement.with_robot(robot)


def _lacks_a_place(placement: Placement) -> bool:
    """Tell whether a robot would stand in the world's origin, on what it is to work at."""
    says = placement.position is not None or placement.on is not None
    return not says and placement.base_position == ORIGIN


def _is_native_name(name: str) -> bool:
    return name.lower().startswith("maniskill.")


def _import(module: str, whose: str) -> None:
    """Import the module of a user that registers tasks.

    Raises:
        TaskError: If that fails.
    """
    try:
        import_module(module)
    except (Exception, SystemExit) as error:  # whatever the code of another package does
        words = f"the module {module!r} {whose} cannot be imported: {reason(error)}"
        raise TaskError(words) from error
