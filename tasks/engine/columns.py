"""Observations under the names of exported datasets; the exports themselves use the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from layouts import Layout
from robot_layouts.simulation import Simulation, State, World
from robot_layouts.simulation.checks.overlaps import empty
from robot_layouts.simulation.maths import Floats, all_finite
from robots.descriptor import Vector3
from tasks.engine.divergence import NotFinite

LEROBOT, FILMED, ROBOMIMIC = COLUMN_MODES = ("lerobot", "lerobot+video", "robomimic")
OVERVIEW = "overview"  # the camera that shows all robots to people
CAMERA = f"observation.images.{OVERVIEW}"  # LeRobot's feature of an exported video
Viewpoint = tuple[Vector3, Vector3]
"""Where a camera is, and the point in the middle of its picture (m, world)."""


def placed_bodies(world: World) -> list[str]:
    """Return the bodies of a world whose poses exports hold: that move, or that a reset places."""
    return [
        name for name, body in world.bodies.items() if body.kind != "static" and not body.anchored
    ]


def lerobot_columns(
    qpos: Mapping[str, Floats], qvel: Mapping[str, Floats], bodies: Floats
) -> dict[str, Floats]:
    """Return what LeRobot's features hold of observations, row by row.

    Args:
        qpos: Place → joint positions, (T, dof) (rad, m), in the order of the descriptors.
        qvel: Place → joint velocities, likewise.
        bodies: Poses of `placed_bodies`, one after the other, (T, 7 · bodies) (m, wxyz).
    """
    columns = {
        "observation.state": np.concatenate(list(qpos.values()), 1),
        "observation.velocity": np.concatenate(list(qvel.values()), 1),
    }
    return columns | ({"observation.environment_state": bodies} if bodies.shape[1] else {})


def robomimic_columns(
    qpos: Mapping[str, Floats],
    qvel: Mapping[str, Floats],
    tcp_poses: Mapping[str, Floats],
    bodies: Floats,
) -> dict[str, Floats]:
    """Return what robomimic's ``obs`` holds, row by row; see `lerobot_columns`.

    Args:
        qpos: Place → joint positions.
        qvel: Place → joint velocities.
        tcp_poses: Place, or limb, → pose of its TCP in the world frame, (T, 7) (m, wxyz).
        bodies: Poses of the bodies.
    """
    columns: dict[str, Floats] = {}
    for place in qpos:
        columns[f"{place}_qpos"] = qpos[place]
        columns[f"{place}_qvel"] = qvel[place]
        columns |= {
            f"{arm}_tcp_pose": poses
            for arm, poses in tcp_poses.items()
            if arm.partition(".")[0] == place
        }
    return columns | ({"object": bodies} if bodies.shape[1] else {})


def picture_column(mode: str, camera: str, texture: str) -> str:
    """Return what exports call the pictures of a camera.

    Args:
        mode: ``"lerobot"`` or ``"robomimic"``, which takes no dots where a network learns from it.
        camera: Its name by place.
        texture: ``"rgb"`` or ``"depth"``.
    """
    if mode == ROBOMIMIC:
        kind = "image" if texture == "rgb" else texture
        return f"{camera.replace('.', '_')}_{kind}"
    return f"observation.images.{camera}" + ("" if texture == "rgb" else f"_{texture}")


def overview(layout: Layout) -> Viewpoint | None:
    """Return camera and target (m, world) that show robots from the side, the first on the left.

    None for a single robot, which has no side.
    """
    if len(layout) == 1:
        return None
    bases = np.array([placement.base_position for placement in layout.values()])
    along = bases[-1] - bases[0]
    span = float(np.linalg.norm(along[:2]))
    if span == 0:
        return None
    aside = np.array([along[1], -along[0], 0.0]) / span
    middle = bases.mean(0)
    eye = middle + span * aside + [0.0, 0.0, 0.42 * span]
    target = middle + [0.0, 0.0, 0.16 * span]
    return tuple(eye.tolist()), tuple(target.tolist())


class ColumnObserver:
    """Observes what an export of the same moment would hold, bit for bit."""

    def __init__(self, layout: Layout, mode: str, viewpoint: Viewpoint) -> None:
        """Remember how to observe.

        Args:
            layout: The robots.
            mode: One of `COLUMN_MODES`.
            viewpoint: The task's own, for a robot that is alone.
        """
        self._layout, self._mode = layout, mode
        self._view = overview(layout) or viewpoint
        self._copies: Simulation | None = None

    def observe(self, simulation: Simulation, state: State) -> dict[str, Any]:
        """Return the columns of all environments, (N, k) each, and pictures, (N, 512, 512, 3).

        Raises:
            NotFinite: If a number is not finite.
        """
        qpos = {place: state.qpos(place) for place in self._layout}
        qvel = {place: state.qvel(place) for place in self._layout}
        none = np.empty((simulation.num_envs, 0), np.float32)
        poses = [state.pose(name) for name in placed_bodies(simulation.worlds[0])]
        bodies = np.concatenate([none, *poses], 1)
        if self._mode == ROBOMIMIC:
            columns = robomimic_columns(qpos, qvel, self._tcp_poses(state), bodies)
        else:
            columns = lerobot_columns(qpos, qvel, bodies)
        if not all(map(all_finite, columns.values())):
            raise NotFinite
        observed: dict[str, Any] = {name: column.copy() for name, column in columns.items()}
        if self._mode == FILMED:
            from robot_layouts.simulation.rendering import (
                Cameras,  # loaded with the first picture
            )

            observed[CAMERA] = Cameras(simulation, *self._view).take()
        return observed

    def close(self) -> None:
        """Let the copies of the robots go."""
        self._copies = None

    def _tcp_poses(self, state: State) -> dict[str, Floats]:
        """Return TCP poses as exports hold them: of robots that are put where these are.

        After a step physics has links within a micrometre of where the joints say; a recording
        holds joints alone.
        """
        count = len(state.joint_positions)
        if self._copies is None:
            self._copies = Simulation(self._layout, empty, count)
        still = np.zeros((count, 6), np.float32)
        rows = {
            place: np.concatenate(
                [state.base_pose(place), still, state.qpos(place), state.qvel(place)], 1
            )
            for place in self._layout
        }
        self._copies.write(range(count), {}, rows)
        read = self._copies.read()
        return {arm: read.tcp_pose(arm) for arm in self._layout.arms}
