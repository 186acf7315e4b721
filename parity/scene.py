"""Pictures of states, whoever computed them, all drawn in the scene of one native environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from parity.lockstep import Snapshot, state_dict
from parity.native import quiet
from robot_layouts.simulation.sapien3.bodies import described_shapes
from robots import RobotLayoutsError
from tasks import TaskEnv

Picture = NDArray[np.uint8]  # (H, W, 3), red, green, blue


class PictureError(RobotLayoutsError, RuntimeError):
    """A state that cannot be drawn, or whose picture would not show what it should."""


class NativeScene:
    """Draws states through native's own camera for people, its goals shown."""

    def __init__(self, env: Any) -> None:
        """Take a native environment; drawing a state changes the one it is in."""
        self._env = env

    def live(self) -> Picture:
        """Return what native's ``render`` shows of the state the environment is in."""
        with quiet():
            return self._env.render_rgb_array()[0].numpy(force=True).copy()

    def draw(self, snapshot: Snapshot) -> Picture:
        """Put a state in and return what it looks like.

        Args:
            snapshot: Of one environment, of the same robots and bodies.

        Raises:
            PictureError: If it lacks a robot or body, has others, or numbers that are not finite.
        """
        state = state_dict(snapshot)
        self._expect_drawable(state)
        self._env.set_state_dict(
            {
                group: {name: torch.from_numpy(rows) for name, rows in entries.items()}
                for group, entries in state.items()
            }
        )
        return self.live()

    def _expect_drawable(self, state: dict[str, dict[str, NDArray[np.float32]]]) -> None:
        registry = self._env.scene.state_dict_registry
        moving = {n for n, actor in registry.actors.items() if actor.px_body_type != "static"}
        for group, wanted in (("actors", moving), ("articulations", set(registry.articulations))):
            if other := sorted(wanted ^ set(state[group])):
                raise PictureError(
                    f"native's {self._env.spec.id} cannot show this state: only one of them has the"
                    f" {group} {', '.join(other)}"
                )
            for name, rows in state[group].items():
                if not np.isfinite(rows).all():
                    raise PictureError(f"{name} cannot be drawn: its state is {rows[0].tolist()}")


def expect_same_shapes(env: Any, task: TaskEnv) -> None:
    """Refuse to draw bodies of ours in native's scene if native's have other shapes.

    A task may draw geometry anew for every episode, and the state dict does not tell it.

    Args:
        env: Native environment.
        task: Ours, with one environment, reset to the same episode.

    Raises:
        PictureError: If the collision shapes of a body differ.
    """
    bodies = task.simulation.worlds[0].bodies
    for name, actor in env.scene.state_dict_registry.actors.items():
        if name in bodies:
            theirs = described_shapes(actor._bodies[0])
            ours = task.simulation.backend.collision_shapes(0, name)
            if theirs != ours:
                raise PictureError(
                    f"{name} has other shapes in native than here, which a picture drawn in"
                    f" native's scene would not show: {theirs} there, {ours} here"
                )


def difference(first: Picture, second: Picture) -> Picture:
    """Return |first - second| of two pictures of the same size."""
    return np.abs(first.astype(np.int16) - second).astype(np.uint8)


def amplified(delta: Picture, gain: float) -> Picture:
    """Return a difference times ``gain``, cut off at 255; what is not 0 stays visible."""
    return np.ceil(np.minimum(delta.astype(np.float64) * gain, 255.0)).astype(np.uint8)
