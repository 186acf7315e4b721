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

StateDict = dict[str, dict[str, Tensor]]


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
        name: torch.cat(
            [state.pose(name), state.linear_velocity(name), state.angular_velocity(name)], 1
        )
        for name, body in simulation.worlds[0].bodies.items()
        if body.kind != "static"
    }
    articulations = {
        key: torch.cat(
            [*_root_rows(simulation, state, name), state.qpos(name), state.qvel(name)], 1
        )
        for name, key in articulation_keys(simulation.layout).items()
    }
    return {"actors": actors, "articulations": articulations}


def _root_rows(simulation: Simulation, state: State, robot: str) -> list[Tensor]:
    roots = [world.robots[robot].articulation.links[0] for world in simulation.worlds]
    return [
        state.link_pose(robot, roots[0].name),
        torch.from_numpy(np.stack([root.linear_velocity for root in roots])),
        torch.from_numpy(np.stack([root.angular_velocity for root in roots])),
    ]


class StateTape:
    """What `read_state_dict` returns, for many moments: cheap to write, put together at the end.

    A tape is for one episode, as it keeps hold of the worlds' bodies: begin it after a reset.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Find what has to be read."""
        world = simulation.worlds[0]
        moving = [name for name, body in world.bodies.items() if body.kind != "static"]
        dynamic = [name for name in moving if world.bodies[name].kind == "dynamic"]
        keys = articulation_keys(simulation.layout)
        self._bodies = {name: place for place, name in enumerate(moving)}
        self._robots = {keys[name]: (len(moving) + i, name) for i, name in enumerate(world.robots)}
        self._joints = simulation.index.joints
        self._frames = [simulation.index.bodies[name] for name in moving]
        self._frames += [simulation.index.bases[name] for name in world.robots]
        self._with_velocity = [self._bodies[name] for name in dynamic]
        self._with_velocity += [place for place, _ in self._robots.values()]
        self._components: list[Any] = [
            component
            for world in simulation.worlds
            for component in (
                *(world.bodies[name].component for name in dynamic),
                *(robot.articulation.links[0] for robot in world.robots.values()),
            )
        ]
        self._rows: list[tuple[Any, ...]] = []

    def write(self, state: State) -> None:
        """Add the present moment; ``state`` must be the read-out of it."""
        velocities = [(part.linear_velocity, part.angular_velocity) for part in self._components]
        self._rows.append(
            (state.poses(self._frames), velocities, state.joint_positions, state.joint_velocities)
        )

    def read(self) -> dict[str, dict[str, NDArray[np.float32]]]:
        """Return every entry of the state dict with all moments, each (moments, N, k)."""
        poses, velocities, qpos, qvel = (np.stack(rows) for rows in zip(*self._rows, strict=True))
        moments, frames, count, _ = poses.shape
        roots = np.zeros((moments, count, frames, 13), np.float32)
        roots[..., :7] = poses.swapaxes(1, 2)
        roots[:, :, self._with_velocity, 7:] = velocities.reshape(moments, count, -1, 6)
        return {
            "actors": {name: roots[:, :, place].copy() for name, place in self._bodies.items()},
            "articulations": {
                key: np.concatenate(
                    [roots[:, :, place], *(q[:, :, self._joints[name]] for q in (qpos, qvel))], 2
                )
                for key, (place, name) in self._robots.items()
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
