"""Pictures of worlds, and whether this machine can draw any."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.cameras import (
    FIELD_OF_VIEW,
    SIZE,
    AnyCamera,
    Camera,
    View,
    ridden,
)
from robot_layouts.simulation.simulation import Simulation
from robots import SimulationError
from robots.descriptor import Vector3

_VULKAN = "import sapien; from sapien.render import RenderSystem; sapien.Scene([RenderSystem()])"
_OPENGL = "from robot_layouts.simulation.mujoco import mujoco; mujoco.GLContext(8, 8)"
_PROBE_SECONDS = 60


class Observers:
    """Cameras that observe: in every world the same ones, which need not see its markers."""

    def __init__(
        self,
        simulation: Simulation,
        cameras: Mapping[str, AnyCamera],
        textures: Sequence[str],
        *,
        markers: bool = False,
    ) -> None:
        """Remember what to look with; cameras are set up when a world is first looked at.

        Args:
            simulation: Worlds that were built with visuals.
            cameras: Camera by its name in observations.
            textures: What to take, some of `robot_layouts.simulation.cameras.TEXTURES`.
            markers: Whether they see markers.

        Raises:
            SimulationError: If the worlds have no visuals.
            UnknownNameError: If a camera rides on a robot, or a link of it, that is not there.
        """
        if not all(world.visuals for world in simulation.worlds):
            raise SimulationError("these worlds have nothing to draw; build them with visuals=True")
        self._simulation, self._cameras, self._textures = simulation, dict(cameras), tuple(textures)
        self._markers = markers
        for robot, link in filter(None, map(ridden, self._cameras.values())):
            simulation.index.robots[robot]
            simulation.index.links[robot].expect(link)

    def look(self, env: int) -> dict[str, View]:
        """Return what every camera sees in one world now, by its name.

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        return self.begin(env)()

    def begin(self, env: int) -> Callable[[], dict[str, View]]:
        """Begin to draw one world, which may not move before the pictures are returned.

        Returns:
            What waits for them, and returns what `look` does.

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        finish = self._simulation.begin_look(
            env, self._cameras, self._textures, markers=self._markers
        )
        return lambda: dict(zip(self._cameras, finish(), strict=True))


class Cameras:
    """One camera per world, all looking from the same place at the same point, for people.

    Cameras and lights live in a scene of their own beside each world's, so that looking at a
    world changes nothing in it.
    """

    def __init__(
        self,
        simulation: Simulation,
        eye: Vector3,
        target: Vector3,
        *,
        camera: Camera | None = None,
    ) -> None:
        """Set a camera up in every world.

        Args:
            simulation: Worlds that were built with visuals.
            eye: Where the cameras are (m, world).
            target: The point in the middle of the picture (m, world).
            camera: Another camera than one of 512 × 512 pixels there.

        Raises:
            SimulationError: If the worlds have no visuals, or ``eye`` and ``target`` coincide.
            UnknownNameError: If it rides on a robot, or a link of it, that is not there.
        """
        view = camera or Camera(eye, target, "view", SIZE, SIZE, FIELD_OF_VIEW)
        self._simulation = simulation
        self._looking = Observers(simulation, {"view": view}, ("rgb",), markers=True)

    def take(self) -> NDArray[np.uint8]:
        """Return what every camera sees now, (N, H, W, 3).

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        views = [self._looking.look(env)["view"] for env in range(self._simulation.num_envs)]
        return np.stack([view.images["rgb"] for view in views]).astype(np.uint8, copy=False)


def drawing_problem(simulator: str) -> str | None:
    """Say in a few words why a simulator draws no pictures on this machine, or return None."""
    return opengl_problem() if simulator == "mujoco" else vulkan_problem()


@functools.cache
def vulkan_problem() -> str | None:
    """Say in a few words why SAPIEN draws no pictures on this machine, or return None.

    Tried once, in a process of its own, as some drivers end the process that asks them.
    """
    return _problem(_VULKAN, "Vulkan")


@functools.cache
def opengl_problem() -> str | None:
    """Say in a few words why MuJoCo draws no pictures on this machine; see `vulkan_problem`."""
    return _problem(_OPENGL, "OpenGL")


def _problem(program: str, driver: str) -> str | None:
    """Run a program that draws; say what is wrong with a driver if it cannot."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            check=False,
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"the {driver} driver did not answer within {_PROBE_SECONDS} s"
    if done.returncode == 0:
        return None
    lines = done.stderr.strip().splitlines()
    last = lines[-1] if lines else f"the process ended with code {done.returncode}"
    return f"no usable {driver} driver ({last})"
