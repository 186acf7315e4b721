"""Wrong numbers, joints and control modes of a base that drives by its speeds: Fetch's."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tasks
from robots import RobotRegistry
from tests.faults.fault import GOES_ON, Fault

AREA = "driving bases"
TASK, PAIR, ROBOT, WIDTH = "PickCube-v1", "TwoRobotPickCube-v1", "fetch_driving", 13

WRONG_GROUPS: dict[str, dict[str, Any]] = {
    "two joints": {"joints": ("root_x_axis_joint", "root_y_axis_joint")},
    "a speed that is NaN": {"upper": (math.nan, 3.14)},
    "speeds the wrong way round": {"upper": (-2.0, 3.14)},
    "speeds that are a delta": {"delta": True},
    "one number for all": {"mimic": True},
    "joints that are held": {"held": True},
    "a command that there is not": {"command": "base_speed"},
}
WRONG_MODES: dict[str, Any] = {
    "of the base": {"base": "pd_joint_vel"},
    "of the arm's base": {"arm.base": "pd_joint_vel"},
    "of nothing": {"arm": None},
    "that is its command": "base_velocity",
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, changes in WRONG_GROUPS.items():
        yield Fault(AREA, f"a group with {name}", partial(_declare, changes))
    yield Fault(AREA, "a mode with its joints in another order", _joints_turned_round)
    yield Fault(AREA, "a mode of a group that there is not", _no_such_group)
    for name, mode in WRONG_MODES.items():
        yield Fault(AREA, f"a control mode {name}", partial(_make, mode))
    yield Fault(AREA, "in_control_mode of a limb", _limb)
    for name in _wrong_actions():
        yield Fault(AREA, f"step with {name}", partial(_step, name))
    yield Fault(AREA, "speeds beyond their bounds", _as_fast_as_it_can, GOES_ON)


@functools.cache
def _task() -> Any:
    return tasks.make(TASK, robots=ROBOT, obs_mode="none", check_layout=False)


def _wrong_actions() -> dict[str, Callable[[], Any]]:
    def spoilt(value: float) -> Any:
        action = np.zeros((1, WIDTH))
        action[0, -1] = value
        return action

    return {
        "NaN": lambda: spoilt(math.nan),
        "no numbers of the base": lambda: np.zeros((1, WIDTH - 2)),
        "the base as if it were a robot": lambda: {"base": np.zeros((1, 2))},
        "the arm's part without the base": lambda: {"arm": np.zeros((1, WIDTH - 2))},
    }


def _descriptor() -> Any:
    return RobotRegistry.load(ROBOT)


def _declare(changes: dict[str, Any], folder: Path) -> None:
    replace(_descriptor().action_split.groups["base"], **changes)


def _joints_turned_round(folder: Path) -> None:
    robot = _descriptor()
    base = robot.action_split.groups["base"]
    turned = replace(base, joints=tuple(reversed(base.joints)))
    replace(robot, control_modes={"fast": {"base": turned}})


def _no_such_group(folder: Path) -> None:
    robot = _descriptor()
    replace(robot, control_modes={"fast": {"wheels": robot.action_split.groups["base"]}})


def _make(mode: Any, folder: Path) -> None:
    tasks.make(TASK, robots=ROBOT, control_mode=mode, obs_mode="none")


def _limb(folder: Path) -> None:
    _descriptor().in_control_mode({"base": "pd_joint_vel"})


def _step(name: str, folder: Path) -> None:
    task = _task()
    task.reset(seed=0)
    before = task.get_state_dict()["articulations"]
    try:
        task.step(_wrong_actions()[name]())
    finally:
        after = task.get_state_dict()["articulations"]
        assert all((rows == after[key]).all() for key, rows in before.items())


def _as_fast_as_it_can(folder: Path) -> str:
    """Ask for five times the speed, in every mode: it drives as with once, to the last bit."""
    for mode in ("pd_joint_delta_pos", "pd_joint_vel", "pd_ee_pose"):
        with closing(
            tasks.make(TASK, robots=ROBOT, control_mode=mode, obs_mode="none", check_layout=False)
        ) as task:
            ends: list[Any] = []
            for speed in (0.5, 1.0, 5.0):
                task.reset(seed=0)
                action = np.zeros((1, task.layout.action_dim), np.float32)
                action[0, -2:] = speed
                for _ in range(5):
                    task.step(action)
                ends.append(next(iter(task.get_state_dict()["articulations"].values())).clone())
            assert (ends[1] == ends[2]).all()
            assert not (ends[0] == ends[1]).all()
    return "the same steps"
