"""What control modes remember, under native's names: a part of observations and state dicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.control.modes import ModeController, Remembered
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.readout import ReadoutIndex
from tasks.arrays import nested as nested

CONTROLLER = "controller"  # native's group of a state dict, and of what a robot observes of itself
_JOINTS = "target_qpos"

_known: WeakKeyDictionary[ModeController, tuple[Entry, ...]] = WeakKeyDictionary()


class Entry(NamedTuple):
    """What a robot remembers under one name of native's.

    Attributes:
        robot: Name of the robot in the layout.
        key: Native's names below the robot, joined by ``/``: ``arm/target_qpos``.
        parts: Which of `ModeController.remembered` it joins.
        sizes: How many numbers each has.
        joints: Whether it is the joints of a whole robot, which native has in another order.
    """

    robot: str
    key: str
    parts: tuple[int, ...]
    sizes: tuple[int, ...]
    joints: bool = False


def entries(simulation: Simulation) -> tuple[Entry, ...]:
    """Return what robots remember, robot by robot.

    Where all that drives a robot of several joint groups remembers joints, native has one
    controller without a name; else each is called like its joint group.
    """
    modes = simulation.modes
    if modes is None or not modes.remembered:
        return ()
    if modes not in _known:
        _known[modes] = _entries(simulation.layout, modes.remembered)
    return _known[modes]


def _entries(layout: Layout, kept: Sequence[Remembered]) -> tuple[Entry, ...]:
    listed: list[Entry] = []
    for robot in layout:
        own = [i for i, part in enumerate(kept) if part.robot == robot]
        sizes = tuple(kept[i].size for i in own)
        if len(own) > 1 and _whole(layout, robot, [kept[i] for i in own]):
            every = sum(sizes) == layout[robot].robot.dof
            listed.append(Entry(robot, _JOINTS, tuple(own), sizes, joints=every))
        else:
            listed += [
                Entry(robot, f"{kept[i].group}/{kept[i].kind}", (i,), (size,))
                for i, size in zip(own, sizes, strict=True)
            ]
    return tuple(listed)


def native_joints(index: ReadoutIndex, robot: str, rows: NDArray[Any]) -> NDArray[Any]:
    """Return joints that are in the order of a robot's descriptor in native's, which is SAPIEN's.

    Args:
        index: Knows both orders.
        robot: Its name in the layout.
        rows: Shape (…, dof).
    """
    order = index.loaded_order[robot]
    return rows if order is None else rows[..., order]


def declared_joints(index: ReadoutIndex, robot: str, rows: NDArray[Any]) -> NDArray[Any]:
    """Return joints that are in native's order in that of a robot's descriptor; see above."""
    order = index.loaded_order[robot]
    return rows if order is None else rows[..., np.argsort(order)]


def recall(simulation: Simulation, entries: Sequence[Entry]) -> list[Floats]:
    """Return copies of the numbers of entries, each (N, k) (rad, m, wxyz)."""
    if not entries or simulation.modes is None:
        return []
    kept = simulation.modes.recall()
    rows = [np.concatenate([kept[i] for i in entry.parts], 1) for entry in entries]
    return [
        native_joints(simulation.index, entry.robot, own) if entry.joints else own
        for entry, own in zip(entries, rows, strict=True)
    ]


def restore(
    simulation: Simulation,
    given: Mapping[str, Floats],
    env_ids: Sequence[int],
    keys: Mapping[str, Entry],
) -> None:
    """Let robots of some worlds remember numbers.

    Args:
        simulation: The worlds.
        given: Rows by native's name, each (worlds, k).
        env_ids: Which worlds.
        keys: Entry by native's name.
    """
    if simulation.modes is None:
        return
    for name, rows in given.items():
        entry = keys[name]
        if entry.joints:
            rows = declared_joints(simulation.index, entry.robot, rows)
        ends = np.cumsum(entry.sizes)[:-1]
        for part, own in zip(entry.parts, np.split(rows, ends, 1), strict=True):
            simulation.modes.restore(part, own, env_ids)


def by_robot(entries: Sequence[Entry], robots: Mapping[str, str | None]) -> dict[str, Entry]:
    """Return entries by native's names, which begin with the robot's key where it has one.

    Args:
        entries: What robots remember.
        robots: Native's key of each robot, or None where native has one robot.
    """
    keys = [robots[entry.robot] for entry in entries]
    return {
        entry.key if key is None else f"{key}/{entry.key}": entry
        for key, entry in zip(keys, entries, strict=True)
    }


def _whole(layout: Layout, robot: str, own: Sequence[Remembered]) -> bool:
    groups = layout[robot].robot.action_split.groups
    driven = {name for name, group in groups.items() if group.size}
    return {part.group for part in own} == driven and all(part.kind == _JOINTS for part in own)
