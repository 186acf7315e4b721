"""Pictures of worlds, all lit alike, and whether this machine can draw any."""

from __future__ import annotations

import functools
import subprocess
import sys
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import sapien
from numpy.typing import NDArray

from robots import SimulationError
from robots.descriptor import Vector3
from simulation.simulation import Simulation
from simulation.world import World

SIZE = 512  # pixels along each side
FIELD_OF_VIEW = 1.0  # rad, vertical
NEAR, FAR = 0.01, 100.0  # m

# Light: red, green, blue; directions point away from the lamp.
SKY = (0.5, 0.53, 0.58)
SUN_DIRECTION, SUN = (-0.2, -0.1, -1.0), (1.6, 1.5, 1.4)
FILL_DIRECTION, FILL = (0.7, 0.5, -0.5), (0.45, 0.48, 0.55)
SHADOW_HALF_WIDTH = 3.0  # of the square in which things cast shadows (m)
SHADOW_DEPTH = 50.0  # above and below the origin; what lies outside is drawn dark (m)
SHADOW_PIXELS = 2048

_PROBE = "import sapien; from sapien.render import RenderSystem; sapien.Scene([RenderSystem()])"
_PROBE_SECONDS = 60


class Cameras:
    """One camera per world, all looking from the same place at the same point.

    Cameras and lights live in a scene of their own beside each world's, so that looking at a
    world changes nothing in it.
    """

    def __init__(self, simulation: Simulation, eye: Vector3, target: Vector3) -> None:
        """Set a camera up in every world.

        Args:
            simulation: Worlds that were built with visuals.
            eye: Where the cameras are (m, world).
            target: The point in the middle of the picture (m, world).

        Raises:
            SimulationError: If the worlds have no visuals, or ``eye`` and ``target`` coincide.
        """
        if not all(world.visuals for world in simulation.worlds):
            raise SimulationError("these worlds have nothing to draw; build them with visuals=True")
        self._simulation, self._pose = simulation, look_at(eye, target)

    def take(self) -> NDArray[np.uint8]:
        """Return what every camera sees now, (N, 512, 512, 3)."""
        return np.stack([_studio(w).take(self._pose) for w in self._simulation.worlds])


class _Studio:
    """The camera and the lights of one world, made once: a render system takes few lights."""

    def __init__(self, world: World) -> None:
        self._scene = sapien.Scene([world.scene.render_system])
        self._scene.set_ambient_light(list(SKY))
        self._scene.add_directional_light(
            list(SUN_DIRECTION),
            list(SUN),
            shadow=True,
            shadow_scale=SHADOW_HALF_WIDTH,
            shadow_near=-SHADOW_DEPTH,
            shadow_far=SHADOW_DEPTH,
            shadow_map_size=SHADOW_PIXELS,
        )
        self._scene.add_directional_light(list(FILL_DIRECTION), list(FILL))
        # Process-wide, bound when a camera is made; others in this process may have changed them.
        sapien.render.set_camera_shader_dir("default")
        sapien.render.set_picture_format("Color", "r32g32b32a32sfloat")
        self._camera: Any = self._scene.add_camera("view", SIZE, SIZE, FIELD_OF_VIEW, NEAR, FAR)

    def take(self, pose: sapien.Pose) -> NDArray[np.uint8]:
        self._camera.entity.set_pose(pose)
        self._scene.update_render()
        self._camera.take_picture()
        color = self._camera.get_picture("Color")[..., :3]
        return (np.clip(color, 0.0, 1.0) * 255).astype(np.uint8)


_studios: WeakKeyDictionary[World, _Studio] = WeakKeyDictionary()


def _studio(world: World) -> _Studio:
    if world not in _studios:
        _studios[world] = _Studio(world)
    return _studios[world]


def look_at(eye: Vector3, target: Vector3) -> sapien.Pose:
    """Return the pose of a camera at ``eye`` that looks at ``target`` with z up (m, world).

    A camera looks along its own +x, with +z up.

    Raises:
        SimulationError: If the two points coincide.
    """
    forward = np.subtract(target, eye)
    distance = float(np.linalg.norm(forward))
    if distance == 0:
        raise SimulationError(f"a camera at {eye} cannot look at the point where it is")
    forward = forward / distance
    up = np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(np.cross(up, forward)) < 1e-6:  # straight down or up: +x is up in the picture
        up = np.array([1.0, 0.0, 0.0])
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([forward, left, np.cross(forward, left)], axis=1)
    matrix[:3, 3] = eye
    return sapien.Pose(matrix)


@functools.cache
def vulkan_problem() -> str | None:
    """Say in a few words why no pictures can be drawn on this machine, or return None.

    Tried once, in a process of its own, as some drivers end the process that asks them.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE],
            capture_output=True,
            text=True,
            check=False,
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"the Vulkan driver did not answer within {_PROBE_SECONDS} s"
    if done.returncode == 0:
        return None
    lines = done.stderr.strip().splitlines()
    last = lines[-1] if lines else f"the process ended with code {done.returncode}"
    return f"no usable Vulkan driver ({last})"
