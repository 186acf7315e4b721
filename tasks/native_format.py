"""The border where native's keys and rows are spoken: state dicts and observation parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from layouts import Layout
from robots import TaskError, unknown_name_message
from simulation import Simulation, State
from simulation.maths import Floats

StateDict = dict[str, dict[str, Tensor]]

_MOMENTS = 128  # that a tape has room for at first: most episodes end before


def observation_keys(layout: Layout) -> dict[str, str | None]:
    """Return native's key of each robot's proprioception; None where native has one robot."""
    if len(layout) == 1:
        return dict.fromkeys(layout)
    return {name: f"{p.robot.name}-{i}" for i, (name, p) in enumerate(layout.items())}


def articulation_keys(layout: Layout) -> dict[str, str]:
    """Return native's state-dict key of each robot."""
    if len(layout) == 1:
        return {name: placement.robot.name for name, placement in layout.items()}
    return {name: f"{p.robot.name}-agent-{i}" for i, (name, p) in enumerate(layout.items())}


def read_state_dict(simulation: Simulation, state: State) -> StateDict:
    """Return every pose and velocity as rows in native's format.

    Bodies that can move are rows of 13: position (m), quaternion (wxyz), linear (m/s) and angular
    velocity (rad/s). Robots are the same of their root, then qpos and qvel.
    """
    actors = {
        name: _joined(state.pose(name), state.linear_velocity(name), state.angular_velocity(name))
        for name, body in simulation.worlds[0].bodies.items()
        if body.kind != "static"
    }
    articulations = {
        key: _joined(*_root_rows(simulation, state, name), state.qpos(name), state.qvel(name))
        for name, key in articulation_keys(simulation.layout).items()
    }
    return {"actors": actors, "articulations": articulations}


def _joined(*parts: Floats) -> Tensor:
    return torch.from_numpy(np.concatenate(parts, 1))


def _root_rows(simulation: Simulation, state: State, robot: str) -> list[Floats]:
    roots = [world.robots[robot].articulation.links[0] for world in simulation.worlds]
    return [
        state.link_pose(robot, roots[0].name),
        np.stack([root.linear_velocity for root in roots]),
        np.stack([root.angular_velocity for root in roots]),
    ]


class StateTape:
    """What `read_state_dict` returns, for many moments: cheap to write, put together at the end.

    A tape is for one episode, as it keeps hold of the worlds' bodies: begin it after a reset, or
    after states were set. A moment is one row of numbers, so that nothing is left over for Python
    to collect: poses, qpos, qvel, velocities of the bodies, velocities of the robots' roots.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Find what has to be read."""
        world, index = simulation.worlds[0], simulation.index
        moving = [name for name, body in world.bodies.items() if body.kind != "static"]
        frames = [index.bodies[name] for name in moving]
        frames += [index.bases[name] for name in world.robots]
        self._frames = np.array(frames, np.intp)
        self._bodies = moving
        self._dynamic = [name for name in moving if world.bodies[name].kind == "dynamic"]
        self._joints = {
            key: index.joints[name] for name, key in articulation_keys(simulation.layout).items()
        }
        self._components: list[Any] = [
            world.bodies[name].component for world in simulation.worlds for name in self._dynamic
        ]
        self._roots: list[Any] = [
            robot.articulation.links[0]
            for world in simulation.worlds
            for robot in world.robots.values()
        ]
        self._count = count = len(simulation.worlds)
        poses, joints, velocities = 7 * count * len(frames), count * index.dof, 6 * count
        widths = poses, joints, joints, velocities * len(self._dynamic)
        self._ends: list[int] = np.cumsum(widths).tolist()
        width = self._ends[-1] + velocities * len(self._joints)
        self._rows: Floats = np.zeros((_MOMENTS, width), np.float32)
        self._length = 0

    def write(self, state: State) -> None:
        """Add the present moment; ``state`` must be the read-out of it."""
        if self._length == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        row = self._rows[self._length]
        parts = [state.poses(self._frames), state.joint_positions, state.joint_velocities]
        for body in self._components:
            parts += (body.linear_velocity, body.angular_velocity)
        np.concatenate(parts, axis=None, out=row[: self._ends[-1]])
        if not self._length:  # roots are fixed: after a step they have no velocity
            velocities = [(root.linear_velocity, root.angular_velocity) for root in self._roots]
            row[self._ends[-1] :] = np.ravel(velocities)
        self._length += 1

    def read(self) -> dict[str, dict[str, NDArray[np.float32]]]:
        """Return every entry of the state dict with all moments, each (moments, N, k)."""
        moments, count = self._length, self._count
        poses, qpos, qvel, velocities, roots = np.split(self._rows[:moments], self._ends, 1)
        frames = poses.reshape(moments, -1, count, 7).swapaxes(0, 1)
        moved, fixed = (
            rows.reshape(moments, count, -1, 6).transpose(2, 0, 1, 3)
            for rows in (velocities, roots)
        )
        qpos, qvel = (rows.reshape(moments, count, -1) for rows in (qpos, qvel))
        velocity = dict(zip(self._dynamic, moved, strict=True))
        still = np.zeros((moments, count, 6), np.float32)
        bases = zip(self._joints.items(), frames[len(self._bodies) :], fixed, strict=True)
        return {
            "actors": {
                name: np.concatenate([pose, velocity.get(name, still)], 2)
                for name, pose in zip(self._bodies, frames, strict=False)
            },
            "articulations": {
                key: np.concatenate([pose, root, qpos[..., joints], qvel[..., joints]], 2)
                for (key, joints), pose, root in bases
            },
        }


def write_state_dict(
    simulation: Simulation, state: Mapping[str, Mapping[str, Any]], env_ids: list[int]
) -> None:
    """Put worlds into a state in native's format.

    Not exact even in native: PhysX's solver memory is no part of it.

    Args:
        simulation: The worlds.
        state: What `read_state_dict` returns, one row per entry of ``env_ids``.
        env_ids: Which worlds.

    Raises:
        TaskError: If a key is unknown or a row has the wrong length; nothing is changed then.
    """
    rows = _checked_rows(simulation, state, len(env_ids))
    robots = {key: name for name, key in articulation_keys(simulation.layout).items()}
    for row, env in enumerate(env_ids):
        world = simulation.worlds[env]
        for name, values in rows["actors"].items():
            world.set_pose(name, values[row, :3], values[row, 3:7])
            if world.bodies[name].kind == "dynamic":
                world.bodies[name].component.set_linear_velocity(values[row, 7:10])
                world.bodies[name].component.set_angular_velocity(values[row, 10:13])
        for key, values in rows["articulations"].items():
            world.robots[robots[key]].restore(values[row])
    simulation.touched()


def _checked_rows(
    simulation: Simulation, state: Mapping[str, Mapping[str, Any]], count: int
) -> dict[str, dict[str, np.ndarray]]:
    widths = {
        "actors": {
            name: 13 for name, body in simulation.worlds[0].bodies.items() if body.kind != "static"
        },
        "articulations": {
            key: 13 + 2 * len(simulation.worlds[0].robots[name].joints)
            for name, key in articulation_keys(simulation.layout).items()
        },
    }
    unknown = [group for group in state if group not in widths]
    if unknown:
        raise TaskError(unknown_name_message("state group", unknown[0], widths))
    rows: dict[str, dict[str, np.ndarray]] = {"actors": {}, "articulations": {}}
    for group, entries in state.items():
        for key, value in entries.items():
            if key not in widths[group]:
                raise TaskError(unknown_name_message(f"entry of {group}", key, widths[group]))
            array = np.atleast_2d(np.asarray(value, np.float32))
            if array.shape != (count, widths[group][key]):
                raise TaskError(
                    f"{group}/{key} has shape {array.shape}; it must be"
                    f" {(count, widths[group][key])}"
                )
            if not np.isfinite(array).all():
                raise TaskError(f"{group}/{key} holds numbers that are not finite")
            rows[group][key] = array
    return rows
