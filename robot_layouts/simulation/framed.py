"""Worlds and states in another frame, and in another size.

A task is declared in numbers for its own robots. Made with others it adds and places its bodies in
a `FramedWorld` and judges a `FramedState`: both speak of the declaration's frame and lengths, which
a `Fit` maps to the world's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np

from objects.shapes import Shape
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.simulation.backend import Pair, Readout, Velocity
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.readout import Moment
from robot_layouts.simulation.state import State
from robot_layouts.simulation.world import World, WorldBody
from robots.descriptor import IDENTITY, Quaternion, Vector3


@dataclass(frozen=True)
class Fit:
    """Where a declaration's frame lies in the world, and how large it is there.

    Attributes:
        scale: Factor on all lengths.
        x: Of its origin (m, world).
        y: Of its origin (m, world).
        yaw: How it is turned about z (rad).
    """

    scale: float = 1.0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @property
    def as_declared(self) -> bool:
        """Whether it changes nothing."""
        return self == AS_DECLARED

    def length(self, declared: float) -> float:
        """Return a declared length as it is here (m)."""
        return declared if self.as_declared else declared * self.scale

    def place(self, declared: Vector3) -> Vector3:
        """Return a declared place as it is here (m, world)."""
        if self.as_declared:
            return declared
        x, y, z = (self.scale * along for along in declared)
        c, s = cos(self.yaw), sin(self.yaw)
        return (self.x + c * x - s * y, self.y + s * x + c * y, z)

    def declared(self, place: Vector3) -> Vector3:
        """Return where a place of the world, (m), is in the declaration (m)."""
        if self.as_declared:
            return place
        x, y, z = place[0] - self.x, place[1] - self.y, place[2]
        c, s = cos(self.yaw), sin(self.yaw)
        return ((c * x + s * y) / self.scale, (c * y - s * x) / self.scale, z / self.scale)

    def turned(self, declared: Quaternion) -> Quaternion:
        """Return a declared orientation as it is here, wxyz."""
        if self.as_declared:
            return declared
        return multiplied((cos(self.yaw / 2), 0.0, 0.0, sin(self.yaw / 2)), declared)


AS_DECLARED = Fit()


class FramedWorld(World):
    """A world that takes places, shapes and sizes as they are declared.

    Joints of bodies are set as they are in the world.
    """

    def __init__(self, world: World, fit: Fit) -> None:
        """Share everything with a world but its frame."""
        vars(self).update(vars(world))
        self._world, self._fit, self.size = world, fit, fit.scale

    @property
    def whole(self) -> World:
        """The world itself."""
        return self._world

    def add(
        self,
        name: str,
        *shapes: Shape,
        position: Vector3 = (0.0, 0.0, 0.0),
        quaternion: Quaternion = IDENTITY,
        **more: Any,
    ) -> WorldBody:
        """Add a body, as much larger as the frame is; see `World.add`."""
        x, y, z, *_ = self._pose(name, position, quaternion)
        place, turn = self._fit.place((x, y, z)), self._fit.turned(quaternion)
        return super().add(name, *shapes, position=place, quaternion=turn, **more)

    def _in_world(self, pose: list[float]) -> list[float]:
        x, y, z, w, i, j, k = pose
        return [*self._fit.place((x, y, z)), *self._fit.turned((w, i, j, k))]


class FramedState(State):
    """A state in a frame and a size of its own: poses, velocities, and how bodies' slides stand.

    Forces are turned into the frame, and as strong as they are (N). Robots' joints are theirs.
    """

    __slots__ = ("_scale",)

    def __init__(self, state: State, fit: Fit, bodies: Mapping[str, WorldBody]) -> None:
        """Take a state of the world.

        Args:
            state: It.
            fit: Where the frame lies, and how large it is.
            bodies: The bodies of a world, by name.
        """
        self._scale = fit.scale
        moment = _FramedMoment(state._moment, fit, bodies)
        joints = state.joint_positions, state.joint_velocities
        super().__init__(Readout(state.all_poses, *joints), state._index, moment)
        x, y, z, *turns = np.moveaxis(state.all_poses, -1, 0)
        place = moment.turned(np.stack((x - fit.x, y - fit.y, z), -1)) / np.float32(fit.scale)
        self.all_poses = np.concatenate((place, _turned_back(turns, fit.yaw)), -1, dtype=np.float32)

    @property
    def scale(self) -> float:
        """How long in the world what the state calls 1 m is (m)."""
        return self._scale


class _FramedMoment(Moment):
    """What is read later, in the frame."""

    __slots__ = ("_bodies", "_fit", "_moment", "_turn")

    def __init__(self, moment: Moment, fit: Fit, bodies: Mapping[str, WorldBody]) -> None:
        self._moment, self._fit, self._bodies = moment, fit, bodies
        c, s = cos(fit.yaw), sin(fit.yaw)
        self._turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], np.float32)

    @property
    def past(self) -> bool:
        """Whether the simulation has moved on."""
        return self._moment.past

    def turned(self, vectors: Floats) -> Floats:
        """Return vectors of the world, (…, 3), in the frame."""
        return vectors @ self._turn

    def velocities(self, wanted: tuple[Velocity, ...]) -> Floats:
        scales = [self._fit.scale if each.kind == "linear" else 1.0 for each in wanted]
        rows = self.turned(self._moment.velocities(wanted))
        return rows / np.array(scales, np.float32)[:, None, None]

    def root_velocities(self) -> Floats:
        rows = self._moment.root_velocities()
        linear, angular = self.turned(rows[..., :3]), self.turned(rows[..., 3:])
        return np.concatenate((linear / self._fit.scale, angular), -1, dtype=np.float32)

    def body_joints(self, body: str) -> Floats:
        kinds = [joint.kind for joint in self._bodies[body].joints] * 2
        scales = [self._fit.scale if kind == "slide" else 1.0 for kind in kinds]
        return self._moment.body_joints(body) / np.array(scales, np.float32)

    def forces(self, pairs: tuple[Pair, ...]) -> Floats | None:
        rows = self._moment.forces(pairs)
        return None if rows is None else self.turned(rows)


def _turned_back(quaternion: Sequence[Floats], yaw: float) -> Floats:
    """Return orientations of the world, the four numbers of each, in a frame turned about z."""
    w, x, y, z = quaternion
    c, s = np.float32(cos(yaw / 2)), np.float32(sin(yaw / 2))
    return np.stack((c * w + s * z, c * x + s * y, c * y - s * x, c * z - s * w), -1)
