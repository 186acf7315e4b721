"""The border where native's keys and rows are spoken: state dicts and observation parts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from layouts import Layout
from objects.solids import part_poses
from robot_layouts.core.bounds import FAR, expect_unit, shown
from robot_layouts.simulation import Simulation, State, World
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.readout import ReadoutIndex
from robot_layouts.simulation.world import WorldBody, part_name
from robots import TaskError, unknown_name_message
from tasks.arrays import array_of, leaves, nested
from tasks.native import controllers
from tasks.native.controllers import CONTROLLER, declared_joints, native_joints

StateDict = dict[str, dict[str, Any]]
"""Tensors by group and entry; those of what control modes remember are nested as in native."""

_BEYOND_LIMITS = 2 * math.pi  # rad, or m
_POSE = tuple(
    f"{what} {axis}"
    for what, axes in (
        ("position", "xyz"),
        ("quaternion", "wxyz"),
        ("linear velocity", "xyz"),
        ("angular velocity", "xyz"),
    )
    for axis in axes
)
_MOMENTS = 128  # that a tape has room for at first: most episodes end before


def observation_keys(layout: Layout) -> dict[str, str | None]:
    """Return native's key of each robot's proprioception; None where native has one robot."""
    if len(layout) == 1:
        return dict.fromkeys(layout)
    return {name: f"{p.robot.name}-{i}" for i, (name, p) in enumerate(layout.items())}


def mode_by_arm(mode: str | Mapping[str, str], layout: Layout) -> str | dict[str, str]:
    """Return a recorded control mode with the layout's names of arms for native's of robots."""
    if isinstance(mode, str):
        return mode
    places = {key: place for place, key in observation_keys(layout).items() if key is not None}
    return {places.get(name, name): own for name, own in mode.items()}


def articulation_keys(layout: Layout) -> dict[str, str]:
    """Return native's state-dict key of each robot."""
    if len(layout) == 1:
        return {name: placement.robot.name for name, placement in layout.items()}
    return {name: f"{p.robot.name}-agent-{i}" for i, (name, p) in enumerate(layout.items())}


def native_places(index: ReadoutIndex, layout: Layout, arm: str) -> NDArray[np.intp]:
    """Return where the joints of a robot, or of a limb, stand among its robot's in native's order.

    A robot's stand as native has them, a limb's in the order of its own descriptor.

    Args:
        index: Knows native's order.
        layout: Whose robot or limb.
        arm: Its name.
    """
    owner = layout.owner(arm)
    joints = layout[owner].robot.joints
    if arm == owner:
        return np.arange(len(joints))
    declared = np.arange(len(joints))
    order = native_joints(index, owner, declared).tolist()
    return np.array([order.index(joints.index(j)) for j in layout.arm(arm).robot.joints], np.intp)


def read_state_dict(simulation: Simulation, state: State) -> StateDict:
    """Return every pose and velocity as rows in native's format.

    Bodies that can move are rows of 13: position (m), quaternion (wxyz), linear (m/s) and angular
    velocity (rad/s). Robots, and bodies with joints, are the same of their root, then qpos and
    qvel. Where a control mode has targets, they are there as ``controller``.
    """
    index = simulation.index
    moving = _moving(simulation)
    actors = {
        name: _joined(state.pose(name), *velocities)
        for name, velocities in zip(moving, state.velocities(moving), strict=True)
    }
    keys, roots = articulation_keys(simulation.layout), state.root_velocities()
    articulations = {
        key: _joined(
            state.base_pose(name),
            root,
            native_joints(index, name, state.qpos(name)),
            native_joints(index, name, state.qvel(name)),
        )
        for (name, key), root in zip(keys.items(), roots, strict=True)
    }
    jointed = _jointed_rows(tuple(_jointed(simulation)), state)
    articulations |= {name: torch.from_numpy(rows) for name, rows in jointed.items()}
    found: StateDict = {"actors": actors, "articulations": articulations}
    if kept := _remembered(simulation):
        found[CONTROLLER] = nested({k: torch.from_numpy(x) for k, x in kept.items()})
    return found


def _remembered(simulation: Simulation) -> dict[str, Floats]:
    """Return what control modes remember by native's names, each (N, k)."""
    rows = controllers.recall(simulation, controllers.entries(simulation))
    return dict(zip(_targets(simulation), rows, strict=True))


def _joined(*parts: Floats) -> Tensor:
    return torch.from_numpy(np.concatenate(parts, 1))


def _jointed_rows(bodies: tuple[str, ...], state: State) -> dict[str, Floats]:
    """Return the rows of bodies with joints, each (N, 13 + 2 · joints)."""
    moved = zip(bodies, state.velocities(bodies), strict=True)
    return {
        name: np.concatenate([state.pose(name), *velocities, state.body_joints(name)], 1)
        for name, velocities in moved
    }


def _moving(simulation: Simulation) -> tuple[str, ...]:
    """Return the names of the bodies that a state dict holds as actors."""
    bodies = simulation.worlds[0].bodies.values()
    rigid = (body for body in bodies if not body.joints and body.part_of is None)
    return tuple(body.name for body in rigid if body.kind != "static")


def _jointed(simulation: Simulation) -> dict[str, WorldBody]:
    """Return the bodies that a state dict holds as articulations."""
    return {name: body for name, body in simulation.worlds[0].bodies.items() if body.joints}


class StateTape:
    """What `read_state_dict` returns, for many moments: cheap to write, put together at the end.

    A moment is one row of numbers, so that nothing is left over for Python to collect: poses, qpos,
    qvel, velocities of the bodies that physics moves, velocities of the robots' roots.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Find what has to be read."""
        world, self._index = simulation.worlds[0], simulation.index
        self._bodies = _moving(simulation)
        self._keys = articulation_keys(simulation.layout)
        frames = [self._index.bodies[name] for name in self._bodies]
        frames += [self._index.bases[name] for name in self._keys]
        self._frames = np.array(frames, np.intp)
        self._dynamic = tuple(n for n in self._bodies if world.bodies[n].kind == "dynamic")
        self._jointed = tuple(_jointed(simulation))
        self._parts: list[dict[str, Floats]] = []
        self._count = count = simulation.num_envs
        poses, joints, velocities = 7 * count * len(frames), count * self._index.dof, 6 * count
        widths = poses, joints, joints, velocities * len(self._dynamic)
        self._ends: list[int] = np.cumsum(widths).tolist()
        width = self._ends[-1] + velocities * len(self._keys)
        self._rows: Floats = np.zeros((_MOMENTS, width), np.float32)
        self._length = 0
        self._simulation = simulation
        self._kept: list[dict[str, Floats]] = []

    def write(self, state: State) -> None:
        """Add the present moment; ``state`` must be the read-out of it."""
        if self._length == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        row = self._rows[self._length]
        parts = (
            state.poses(self._frames),
            state.joint_positions,
            state.joint_velocities,
            state.velocities(self._dynamic),
        )
        np.concatenate(parts, axis=None, out=row[: self._ends[-1]])
        if not self._length:  # roots are fixed: after a step they have no velocity
            row[self._ends[-1] :] = state.root_velocities().ravel()
        if self._simulation.modes is not None:
            self._kept.append(_remembered(self._simulation))
        if self._jointed:
            self._parts.append(_jointed_rows(self._jointed, state))
        self._length += 1

    def read(self) -> dict[str, dict[str, NDArray[np.float32]]]:
        """Return every entry of the state dict with all moments, each (moments, N, k)."""
        moments, count = self._length, self._count
        poses, qpos, qvel, moved, roots = np.split(self._rows[:moments], self._ends, 1)
        frames = poses.reshape(moments, -1, count, 7).swapaxes(0, 1)
        moved = moved.reshape(moments, -1, 2, count, 3).transpose(1, 0, 3, 2, 4)
        moved = moved.reshape(-1, moments, count, 6)
        fixed = roots.reshape(moments, -1, count, 6).swapaxes(0, 1)
        qpos, qvel = (rows.reshape(moments, count, -1) for rows in (qpos, qvel))
        velocity = dict(zip(self._dynamic, moved, strict=True))
        still = np.zeros((moments, count, 6), np.float32)
        bases = zip(self._keys.items(), frames[len(self._bodies) :], fixed, strict=True)
        names = self._kept[0] if self._kept else ()
        kept = {name: np.stack([rows[name] for rows in self._kept]) for name in names}
        return {
            "actors": {
                name: np.concatenate([pose, velocity.get(name, still)], 2)
                for name, pose in zip(self._bodies, frames, strict=False)
            },
            "articulations": {
                key: np.concatenate([pose, root, self._own(qpos, name), self._own(qvel, name)], 2)
                for (name, key), pose, root in bases
            }
            | {name: np.stack([rows[name] for rows in self._parts]) for name in self._jointed},
            **({CONTROLLER: kept} if kept else {}),
        }

    def _own(self, joints: Floats, robot: str) -> Floats:
        return native_joints(self._index, robot, joints[..., self._index.joints[robot]])


def row_of(body: WorldBody) -> tuple[str, str]:
    """Return group and entry of a body's row in a state dict."""
    return ("articulations" if body.joints else "actors"), body.name


def body_poses(world: World, states: Mapping[str, Mapping[str, NDArray[Any]]]) -> dict[str, Floats]:
    """Return the poses of bodies that recorded states tell of, each (T, 7) (m, wxyz).

    Those of parts that joints move follow from the joints.

    Args:
        world: The bodies as declared.
        states: Rows by group and entry, each (T, k).
    """
    actors, articulations = (states.get(group, {}) for group in ("actors", "articulations"))
    found = {name: rows[:, :7] for name, rows in actors.items() if name in world.bodies}
    for name, body in world.bodies.items():
        if body.joints and name in articulations:
            rows = articulations[name]
            found[name] = rows[:, :7]
            joints = rows[:, 13 : 13 + len(body.joints)]
            for joint, poses in part_poses(body.joints, rows[:, :7], joints).items():
                found[part_name(name, joint)] = poses.astype(np.float32)
    return found


def write_state_dict(
    simulation: Simulation, state: Mapping[str, Mapping[str, Any]], env_ids: list[int]
) -> None:
    """Put worlds into a state in native's format.

    Not exact even in native: PhysX's solver memory is no part of it.

    Numbers must be finite and at most `robot_layouts.core.bounds.FAR`, quaternions of length 1, and
    joints within a full turn (rad; or 2π m) of their limits: joint noise and contacts push them a
    little beyond. Targets of control modes that are left out stay as they are.

    Args:
        simulation: The worlds.
        state: What `read_state_dict` returns, one row per entry of ``env_ids``.
        env_ids: Which worlds.

    Raises:
        TaskError: If a key is unknown, a row has the wrong length, or a number is invalid; says
            in which entry and environment. Nothing is changed then.
    """
    rows = _checked_rows(simulation, state, env_ids)
    robots: dict[str, Floats] = {}
    for name, key in articulation_keys(simulation.layout).items():
        if key in rows["articulations"]:
            row = rows["articulations"][key]
            pose, qpos, qvel = np.split(row, (13, 13 + simulation.layout[name].robot.dof), 1)
            joints = (declared_joints(simulation.index, name, part) for part in (qpos, qvel))
            robots[name] = np.concatenate([pose, *joints], 1)
    jointed = _jointed(simulation)
    things = {key: row for key, row in rows["articulations"].items() if key in jointed}
    simulation.write(env_ids, rows["actors"] | things, robots)
    if rows.get(CONTROLLER):
        controllers.restore(simulation, rows[CONTROLLER], env_ids, _targets(simulation))


def _targets(simulation: Simulation) -> dict[str, controllers.Entry]:
    """Return what control modes remember by native's names."""
    return controllers.by_robot(
        controllers.entries(simulation), observation_keys(simulation.layout)
    )


class _Entry(NamedTuple):
    """What the numbers of one row are called, and their bounds, each (k,)."""

    names: tuple[str, ...]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]


def _checked_rows(
    simulation: Simulation, state: Mapping[str, Mapping[str, Any]], env_ids: Sequence[int]
) -> dict[str, dict[str, Floats]]:
    known = _entries(simulation)
    rows: dict[str, dict[str, Floats]] = {group: {} for group in known}
    for group, values in _items(state, "the state"):
        if group not in known:
            raise TaskError(unknown_name_message("state group", group, known))
        if group == CONTROLLER and isinstance(values, Mapping):
            values = dict(leaves(values))
        for key, value in _items(values, group):
            if key not in known[group]:
                raise TaskError(unknown_name_message(f"entry of {group}", key, known[group]))
            what, entry = f"{group}/{key}", known[group][key]
            array = _checked_array(value, what, (len(env_ids), len(entry.names)))
            _check_numbers(array, what, entry, env_ids, quaternion=_quaternion(group, key))
            rows[group][key] = array
    return rows


def _entries(simulation: Simulation) -> dict[str, dict[str, _Entry]]:
    """Return what a state dict of these worlds holds."""
    articulations: dict[str, _Entry] = {}
    for name, key in articulation_keys(simulation.layout).items():
        built, declared = simulation.index.robots[name], simulation.layout[name].robot.joints
        joints = [declared[i] for i in built.loaded_order]
        articulations[key] = _jointed_entry(joints, *built.limits[list(built.loaded_order)].T)
    for name, body in _jointed(simulation).items():
        ends = np.array([joint.limits for joint in body.joints])
        articulations[name] = _jointed_entry([joint.name for joint in body.joints], *ends.T)
    targets = {
        key: _Entry(tuple(f"number {i}" for i in range(k)), np.full(k, -FAR), np.full(k, FAR))
        for key, k in ((key, sum(e.sizes)) for key, e in _targets(simulation).items())
    }
    return {
        "actors": dict.fromkeys(_moving(simulation), _ROW),
        "articulations": articulations,
        **({CONTROLLER: targets} if targets else {}),
    }


_ROW = _Entry(_POSE, np.full(13, -FAR), np.full(13, FAR))


def _jointed_entry(joints: Sequence[str], low: Floats, high: Floats) -> _Entry:
    """Return what a row of something with joints holds, whose limits are given (rad, m)."""
    fastest = np.full(len(joints), FAR)
    return _Entry(
        (*_POSE, *(f"{what} of {joint}" for what in ("qpos", "qvel") for joint in joints)),
        np.concatenate([_ROW.lowest, np.maximum(low - _BEYOND_LIMITS, -FAR), -fastest]),
        np.concatenate([_ROW.highest, np.minimum(high + _BEYOND_LIMITS, FAR), fastest]),
    )


def _quaternion(group: str, key: str) -> bool:
    """Return whether numbers 3 to 6 of an entry are a quaternion."""
    return group != CONTROLLER or key.endswith("target_pose")


def _items(entries: Any, what: str) -> Iterable[tuple[Any, Any]]:
    if not isinstance(entries, Mapping):
        raise TaskError(
            f"{what} is {shown(entries)}; it must be a mapping, as get_state_dict() returns it"
        )
    return entries.items()


def _checked_array(value: Any, what: str, shape: tuple[int, int]) -> Floats:
    array = array_of(value, what, TaskError)
    if array.dtype.kind not in "fiu":
        raise TaskError(f"{what} has dtype {array.dtype}; it must hold numbers (float32)")
    array = np.atleast_2d(array)
    if array.shape != shape:
        raise TaskError(f"{what} has shape {array.shape}; it must be {shape}")
    with np.errstate(over="ignore"):  # what is too large is refused as inf
        return array.astype(np.float32)


def _check_numbers(
    array: Floats, what: str, entry: _Entry, env_ids: Sequence[int], *, quaternion: bool
) -> None:
    wrong = np.argwhere(~((entry.lowest <= array) & (array <= entry.highest)))
    if len(wrong):
        row, place = (int(i) for i in wrong[0])
        low, high = entry.lowest[place], entry.highest[place]
        raise TaskError(
            f"{what}: {entry.names[place]} is {array[row, place]:g} for environment {env_ids[row]};"
            f" a number from {low:g} to {high:g} is needed"
        )
    if not quaternion:
        return
    for env, turn in zip(env_ids, array[:, 3:7].tolist(), strict=True):
        about = f"{what}: the quaternion (numbers 3 to 6) for environment {env}"
        expect_unit(about, turn, TaskError)
