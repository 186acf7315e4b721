"""Draws what a randomization varies in a task's worlds, and lets them differ by it."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.kinematics.quaternions import multiplied, yaw_quaternion
from robot_layouts.simulation import Camera, Simulation, State, World
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.variation import Variation
from robots.descriptor import Vector3
from tasks.arrays import leaves
from tasks.randomization.declaration import AXES, Randomization
from tasks.randomization.distractors import Rectangle, Scattering
from tasks.randomization.distributions import Stream
from tasks.randomization.groups import Group
from tasks.randomization.looks import looks
from tasks.randomization.noise import ActionDelay, ActionNoise, Noisy, ObservationDelay, SensorNoise
from tasks.randomization.targets import offers, targets

DRAWN = "drawn"  # what the names of what was drawn begin with in ``info``

_AT_EVERY_STEP = ("action_noise", "sensor_noise")


class Randomizer:
    """What varies in N worlds, and what was last drawn for each of them.

    Attributes:
        rebuilds: Whether every reset builds worlds anew, since something varies that cannot be
            changed in place.
    """

    def __init__(
        self,
        randomization: Randomization,
        simulation: Simulation,
        cameras: Sequence[Camera],
        area: Rectangle,
    ) -> None:
        """Look up what the names of a randomization mean.

        Args:
            randomization: What varies.
            simulation: The worlds.
            cameras: The task's own cameras.
            area: Where distractors go if that is not declared; x_min, y_min, x_max, y_max (m).

        Raises:
            UnknownNameError: If one means nothing.
        """
        self._declared = declared = randomization.declared
        self._layout = simulation.layout
        own = declared["distractors"].names_of_bodies if "distractors" in declared else ()
        self._targets = {
            axis: targets(axis, declared[axis], offered(simulation))
            for axis, offered in offers(cameras, own).items()
            if axis in declared
        }
        self.rebuilds = any(AXES[axis].rebuilds for axis in declared)
        count = simulation.num_envs
        self._streams = [Stream(0)] * count
        self._drawn: list[dict[str, Any]] = [{} for _ in range(count)]
        self._standing = [self._layout] * count
        self._noise = ActionNoise(self._targets.get("action_noise", {}))
        self._sensors = SensorNoise(declared.get("sensor_noise", {}))
        self._sending = ActionDelay(count) if "action_delay" in declared else None
        self._seeing = ObservationDelay(count) if "observation_delay" in declared else None
        self._scattering: Scattering | None = None
        if "distractors" in declared:
            self._scattering = Scattering(declared["distractors"], area)

    # -- drawing -----------------------------------------------------------------------------

    def begin(self, env: int, stream: Stream) -> None:
        """Draw what varies in the coming episode of an environment."""
        self._streams[env] = stream
        drawn = self._drawn[env] = self._draw(stream)
        if "bases" in drawn:
            self._standing[env] = _shifted(self._layout, drawn["bases"])
        if self._sending is not None:
            self._sending.begin(env, drawn["action_delay"])
        if self._seeing is not None:
            self._seeing.begin(env, drawn["observation_delay"])

    def drawn(self, env: int) -> dict[str, Any]:
        """Return what was drawn for an environment, by axis and name, as plain data."""
        return copy.deepcopy(self._drawn[env])

    def info(self) -> dict[str, NDArray[np.float32]]:
        """Return what was drawn for all environments, (N,) each: ``drawn/mass/cube``."""
        rows = [dict(leaves(drawn, DRAWN)) for drawn in self._drawn]
        return {name: np.array([row[name] for row in rows], np.float32) for name in rows[0]}

    def layout(self, env: int) -> Layout:
        """Return the layout as robots stand in the present episode of an environment."""
        return self._standing[env]

    def spread(self, env: int) -> float:
        """Return the share of its area within which each body begins in an environment."""
        return self._drawn[env].get("spread", 1.0)

    def scale(self, body: str) -> Floats:
        """Return the factor on the size of a body in each environment, (N,)."""
        scales = [self._scales(drawn).get(body, 1.0) for drawn in self._drawn]
        return np.array(scales, np.float32)

    # -- worlds ------------------------------------------------------------------------------

    def describe(self, world: World, env: int) -> None:
        """Say what cannot be changed in a world once it is built."""
        drawn = self._drawn[env]
        world.scales = self._scales(drawn)
        if "gravity" in drawn:
            gravity = _of_strength(world.physics.gravity, drawn["gravity"])
            world.physics = replace(world.physics, gravity=gravity)

    def apply(self, simulation: Simulation, env_ids: Sequence[int]) -> None:
        """Let worlds differ by what was drawn; their reset has begun."""
        simulation.vary({env: self._variation(env) for env in env_ids})

    def scatter(self, simulation: Simulation, state: State, env_ids: Sequence[int]) -> bool:
        """Put distractors where they are clear of everything, and tell whether there are any."""
        if self._scattering is None:
            return False
        drawn = {env: self._drawn[env]["distractors"] for env in env_ids}
        self._scattering.scatter(simulation, state, drawn, self._streams)
        return True

    # -- steps -------------------------------------------------------------------------------

    def rest(self, simulation: Simulation, state: State, env_ids: Sequence[int]) -> None:
        """End a reset: joints are held where they are until an action arrives."""
        if self._sending is not None:
            simulation.rest(state, env_ids)

    def step(
        self,
        simulation: Simulation,
        actions: Floats,
        joint_positions: Floats,
        env_ids: Sequence[int],
        elapsed: NDArray[np.int32],
    ) -> None:
        """Advance worlds by one control step, by what arrives of their actions.

        Args:
            simulation: The worlds.
            actions: What is asked of all environments, (N, A).
            joint_positions: Before the step, (N, dof) (rad, m).
            env_ids: Which move.
            elapsed: Control steps that each has taken, (N,).
        """
        waiting: list[int] = []
        if self._sending is not None:
            actions, waiting = self._sending.arriving(actions, env_ids)
        actions = self._noise.added(actions, self._streams, elapsed.tolist())
        moving = [env for env in env_ids if env not in waiting]
        if moving:
            simulation.step(actions, joint_positions, moving)
        if waiting:
            simulation.coast(waiting)

    def sensors(
        self, parts: Callable[[], Sequence[str]], elapsed: NDArray[np.int32]
    ) -> Noisy | None:
        """Return what adds the noise of this moment to parts of observations; None if none is.

        Args:
            parts: Returns the names of all that is observed.
            elapsed: Control steps that each environment has taken, (N,).

        Raises:
            UnknownNameError: If noise was declared for a part that does not exist.
            TaskError: If what is observed has no parts.
        """
        if "sensor_noise" not in self._declared:
            return None
        self._sensors.expect(parts())
        return self._sensors.on(self._streams, elapsed.tolist())

    def seen(self, observation: Any, env_ids: Sequence[int]) -> Any:
        """Return observations as old as they are seen; see `ObservationDelay.seen`."""
        return observation if self._seeing is None else self._seeing.seen(observation, env_ids)

    # -- inside ------------------------------------------------------------------------------

    def _draw(self, stream: Stream) -> dict[str, Any]:
        drawn: dict[str, Any] = {}
        for axis, declared in self._declared.items():
            if axis in _AT_EVERY_STEP:
                continue
            if AXES[axis].named:
                named = self._targets[axis].items()
                drawn[axis] = {name: _value(t.takes, stream, axis, name) for name, t in named}
            else:
                drawn[axis] = _value(declared, stream, axis)
        return drawn

    def _variation(self, env: int) -> Variation:
        drawn = self._drawn[env]
        factors = {
            axis: self._each(drawn, axis)
            for axis in ("mass", "friction", "stiffness", "damping", "joint_friction")
        }
        standing = self._standing[env] if "bases" in drawn else {}
        bases = {name: (p.base_position, p.base_quaternion) for name, p in standing.items()}
        paints = self._scattering.paints(drawn["distractors"]) if self._scattering else {}
        seen = looks(lambda axis: self._each(drawn, axis), paints)
        return Variation(**factors, bases=bases, looks=seen)

    def _scales(self, drawn: Mapping[str, Any]) -> dict[str, float]:
        return self._each(drawn, "size")

    def _each(self, drawn: Mapping[str, Any], axis: str) -> dict[Any, Any]:
        """Return what was drawn for each single thing."""
        values, named = drawn.get(axis, {}), self._targets.get(axis, {})
        return {thing: values[name] for name, target in named.items() for thing in target.means}


def _value(takes: Any, stream: Stream, *names: str) -> Any:
    """Return what is drawn for a name: a number, or those of a group by field."""
    if isinstance(takes, Group):
        takes = takes.drawn
    if isinstance(takes, Mapping):
        return {name: _value(drawn, stream, *names, name) for name, drawn in takes.items()}
    return takes.value(stream.number(*names))


def _of_strength(gravity: Vector3, strength: float) -> Vector3:
    """Return a vector in the direction of another, or downwards if that is zero (m/s²)."""
    length = float(np.linalg.norm(gravity))
    x, y, z = gravity if length else (0.0, 0.0, -1.0)
    share = strength / (length or 1.0)
    return x * share, y * share, z * share


def _shifted(layout: Layout, shifts: Mapping[str, Mapping[str, float]]) -> Layout:
    """Return a layout whose robots stand off their placements; what hangs on them follows.

    Args:
        layout: As it was declared.
        shifts: By robot: ``x``, ``y``, ``z`` (m) and ``yaw`` (rad), as far as they vary.
    """
    placements = dict(layout)
    for name, shift in shifts.items():
        pose = layout[name].local_pose
        x, y, z = (a + shift.get(axis, 0.0) for a, axis in zip(pose.position, "xyz", strict=True))
        turned = pose.quaternion
        if yaw := shift.get("yaw", 0.0):
            turned = multiplied(yaw_quaternion(yaw), turned)
        placements[name] = replace(layout[name], position=(x, y, z), quaternion=turned, rpy=None)
    return Layout(placements, layout.frames)
