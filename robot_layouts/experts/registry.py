"""Which tasks have an expert, by task id."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import shown
from robot_layouts.core.catalogue import Catalogue
from robots import TaskError
from tasks import TaskEnv, get_task_class

Expert = Callable[[TaskEnv, int], NDArray[np.float32]]
"""``expert(task, seed)`` returns actions (T, A) for the episode that ``seed`` begins.

The task says which layout and physics to plan for and is itself left alone: experts plan in worlds
of their own. The actions hold for freshly built worlds, ``reset(seed, {"reconfigure": True})``.
"""

# One line per task, sorted by id: id -> module:function.
CATALOGUE = {
    "CellBalanceBall-v1": "robot_layouts.experts.cells.balance_ball:balance_ball",
    "CellBuildBridge-v1": "robot_layouts.experts.cells.build_bridge:build_bridge",
    "CellBuildGate-v1": "robot_layouts.experts.cells.build_gate:build_gate",
    "CellCarryBeam-v1": "robot_layouts.experts.cells.carry_beam:carry_beam",
    "CellCloseDrawers-v1": "robot_layouts.experts.cells.close_drawers:close_drawers",
    "CellCrossOver-v1": "robot_layouts.experts.cells.cross_over:cross_over",
    "CellFillDrawer-v1": "robot_layouts.experts.cells.fill_drawer:fill_drawer",
    "CellFillHeldBin-v1": "robot_layouts.experts.cells.fill_held_bin:fill_held_bin",
    "CellGatherBlocks-v1": "robot_layouts.experts.cells.gather_blocks:gather_blocks",
    "CellHammerPegs-v1": "robot_layouts.experts.cells.hammer_pegs:hammer_pegs",
    "CellHandMugOn-v1": "robot_layouts.experts.cells.hand_mug_on:hand_mug_on",
    "CellHangBrackets-v1": "robot_layouts.experts.cells.hang_brackets:hang_brackets",
    "CellHoldAndPush-v1": "robot_layouts.experts.cells.hold_and_push:hold_and_push",
    "CellHoldGate-v1": "robot_layouts.experts.cells.hold_gate:hold_gate",
    "CellInsertPegs-v1": "robot_layouts.experts.cells.insert_pegs:insert_pegs",
    "CellLiftBoard-v1": "robot_layouts.experts.cells.lift_board:lift_board",
    "CellLiftPot-v1": "robot_layouts.experts.cells.lift_pot:lift_pot",
    "CellLoadTray-v1": "robot_layouts.experts.cells.load_tray:load_tray",
    "CellMountGears-v1": "robot_layouts.experts.cells.mount_gears:mount_gears",
    "CellMovePot-v1": "robot_layouts.experts.cells.move_pot:move_pot",
    "CellOpenBox-v1": "robot_layouts.experts.cells.open_box:open_box",
    "CellPackKit-v1": "robot_layouts.experts.cells.pack_kit:pack_kit",
    "CellPackTote-v1": "robot_layouts.experts.cells.pack_tote:pack_tote",
    "CellPassAround-v1": "robot_layouts.experts.cells.pass_around:pass_around",
    "CellPassGlass-v1": "robot_layouts.experts.cells.pass_glass:pass_glass",
    "CellPressInOrder-v1": "robot_layouts.experts.cells.press_in_order:press_in_order",
    "CellPressTogether-v1": "robot_layouts.experts.cells.press_together:press_together",
    "CellPushBar-v1": "robot_layouts.experts.cells.push_bar:push_bar",
    "CellPutAndClose-v1": "robot_layouts.experts.cells.put_and_close:put_and_close",
    "CellPutAway-v1": "robot_layouts.experts.cells.put_away:put_away",
    "CellRaiseFrame-v1": "robot_layouts.experts.cells.raise_frame:raise_frame",
    "CellRakeAndPlace-v1": "robot_layouts.experts.cells.rake_and_place:rake_and_place",
    "CellRelay-v1": "robot_layouts.experts.cells.relay:relay",
    "CellRunPlant-v1": "robot_layouts.experts.cells.run_plant:run_plant",
    "CellServe-v1": "robot_layouts.experts.cells.serve:serve",
    "CellSetFaders-v1": "robot_layouts.experts.cells.set_faders:set_faders",
    "CellShiftRing-v1": "robot_layouts.experts.cells.shift_ring:shift_ring",
    "CellShutSuitcase-v1": "robot_layouts.experts.cells.shut_suitcase:shut_suitcase",
    "CellSortByWord-v1": "robot_layouts.experts.cells.sort_by_word:sort_by_word",
    "CellSortCubes-v1": "robot_layouts.experts.cells.sort_cubes:sort_cubes",
    "CellSqueezeBox-v1": "robot_layouts.experts.cells.squeeze_box:squeeze_box",
    "CellStackInOrder-v1": "robot_layouts.experts.cells.stack_in_order:stack_in_order",
    "CellStowTwo-v1": "robot_layouts.experts.cells.stow_two:stow_two",
    "CellSwapPlaces-v1": "robot_layouts.experts.cells.swap_places:swap_places",
    "CellSweepBlocks-v1": "robot_layouts.experts.cells.sweep_blocks:sweep_blocks",
    "CellTakeSides-v1": "robot_layouts.experts.cells.take_sides:take_sides",
    "CellThrowLevers-v1": "robot_layouts.experts.cells.throw_levers:throw_levers",
    "CellTurnTaps-v1": "robot_layouts.experts.cells.turn_taps:turn_taps",
    "CellTwoHandPress-v1": "robot_layouts.experts.cells.two_hand_press:two_hand_press",
    "CellUnloadTurntable-v1": "robot_layouts.experts.cells.unload_turntable:unload_turntable",
    "CellUnlock-v1": "robot_layouts.experts.cells.unlock:unlock",
    "DrawTriangle-v1": "robot_layouts.experts.maniskill.draw_triangle:draw_outline",
    "FourRobotStack-v1": "robot_layouts.experts.originals.four_robot_stack:stack_for_four",
    "LiftPegUpright-v1": "robot_layouts.experts.maniskill.lift_peg_upright:stand_up",
    "PegInsertionSide-v1": "robot_layouts.experts.maniskill.peg_insertion_side:insert_peg",
    "PickCube-v1": "robot_layouts.experts.maniskill.pick_cube:pick_cube",
    "PickCubeSO100-v1": "robot_layouts.experts.maniskill.pick_cube_so100:pick_small_cube",
    "PlaceSphere-v1": "robot_layouts.experts.maniskill.place_sphere:place_sphere",
    "PlugCharger-v1": "robot_layouts.experts.maniskill.plug_charger:plug_in",
    "PokeCube-v1": "robot_layouts.experts.maniskill.poke_cube:poke",
    "PullCube-v1": "robot_layouts.experts.maniskill.slide_cube:slide",
    "PullCubeTool-v1": "robot_layouts.experts.maniskill.pull_cube_tool:pull",
    "PushCube-v1": "robot_layouts.experts.maniskill.slide_cube:slide",
    "PushT-v1": "robot_layouts.experts.maniskill.push_t:push_onto_outline",
    "Relay-v1": "robot_layouts.experts.originals.relay:pass_on",
    "RollBall-v1": "robot_layouts.experts.maniskill.roll_ball:roll",
    "StackCube-v1": "robot_layouts.experts.maniskill.stack_cube:stack_cube",
    "StackPyramid-v1": "robot_layouts.experts.maniskill.stack_pyramid:stack_pyramid",
    "TwoRobotHandOver-v1": "robot_layouts.experts.originals.two_robot_hand_over:hand_over",
    "TwoRobotLiftBar-v1": "robot_layouts.experts.originals.two_robot_lift_bar:lift_for_two",
    "TwoRobotPickCube-v1": "robot_layouts.experts.maniskill.two_robot_pick_cube:hand_over",
    "TwoRobotPushPick-v1": "robot_layouts.experts.originals.two_robot_push_pick:push_and_pick",
    "TwoRobotStackCube-v1": "robot_layouts.experts.maniskill.two_robot_stack_cube:stack_for_two",
}


def _check(given: object, origin: str, name: str) -> Expert:
    """Return what an entry point gave, if it can be an expert."""
    if not callable(given):
        raise TaskError(
            f"{origin} gave {shown(given)}; the expert of {name} is needed, a function of a task"
            " and a seed"
        )
    return cast(Expert, given)


EXPERTS = Catalogue(
    "expert",
    CATALOGUE,
    group="robot_layouts.experts",
    check=_check,
    error=TaskError,
    ignore_case=True,
)


def register_expert(task_id: str, expert: Expert) -> Expert:
    """Make an expert known for a task, in place of the present one if there is one.

    Raises:
        UnknownNameError: If there is no such task.
    """
    EXPERTS.register(get_task_class(task_id).task_id, expert)
    return expert


def find_expert(task_id: str) -> Expert:
    """Return the expert of a task.

    Other packages bring experts through the entry points ``robot_layouts.experts``, named as the
    tasks that they solve.

    Args:
        task_id: The task's id or another of its names.

    Raises:
        UnknownNameError: If there is no such task.
        TaskError: If the task has no expert, or another package brings it and that goes wrong.
    """
    name = get_task_class(task_id).task_id
    if name not in EXPERTS:
        raise TaskError(f"{name} has no expert yet; tasks with one: {', '.join(list_experts())}")
    return EXPERTS[name]


def list_experts() -> tuple[str, ...]:
    """Return the ids of all tasks that have an expert, sorted."""
    return tuple(EXPERTS)
