"""How far the shapes of bodies reach."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco.library import mujoco

_TYPE = mujoco.mjtGeom


def extent_of(model: Any, data: Any, body: int) -> Floats | None:
    """Return the box around what collides of a body, (2, 3) (m, world); None if nothing does.

    Planes are left out. Where the bodies are must have been computed.
    """
    boxes = [_box(model, data, geom) for geom in _solids(model, body)]
    if not boxes:
        return None
    lows, highs = zip(*boxes, strict=True)
    return np.array([np.min(lows, 0), np.max(highs, 0)], np.float32)


def lowest_of(model: Any, data: Any, body: int) -> float | None:
    """Return the height of the lowest point of a body (m, world), likewise."""
    lows = [_box(model, data, geom)[0][2] for geom in _solids(model, body)]
    return min(lows) if lows else None


def _solids(model: Any, body: int) -> list[int]:
    first = model.body_geomadr[body]
    geoms = range(first, first + model.body_geomnum[body])
    return [
        geom
        for geom in geoms
        if model.geom_contype[geom] and model.geom_type[geom] != _TYPE.mjGEOM_PLANE
    ]


def _box(model: Any, data: Any, geom: int) -> tuple[Floats, Floats]:
    """Return the lowest and the highest corner of the box around a geom, each (3,) (m, world)."""
    place, turn = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    size = model.geom_size[geom]
    along = np.abs(turn[:, 2])  # of its own z axis, on each axis of the world
    match model.geom_type[geom]:
        case _TYPE.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ turn.T + place
            return corners.min(0), corners.max(0)
        case _TYPE.mjGEOM_BOX:
            reach = np.abs(turn) @ size
        case _TYPE.mjGEOM_SPHERE:
            reach = np.full(3, size[0])
        case _TYPE.mjGEOM_CAPSULE:
            reach = size[0] + along * size[1]
        case _:  # a cylinder
            reach = size[0] * np.sqrt(np.maximum(0.0, 1 - along**2)) + along * size[1]
    return place - reach, place + reach
