"""Draws recorded episodes, moment by moment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import numpy as np

from robot_layouts.data.export.columns import Columns, state_row
from robot_layouts.data.export.shots import RGB, Channel, Frame, Picture, Shots
from robot_layouts.data.reading.recording import TrajectoryError
from robot_layouts.data.video import INSTALL
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.rendering import SIZE, Cameras, Observers, vulkan_problem
from robots import MissingPackageError, SimulationError
from tasks import TaskEnv
from tasks.engine.columns import OVERVIEW
from tasks.episode import States, moments, open_loop

SHAPE = (SIZE, SIZE, 3)  # of the overview


def require_pictures(*, video: bool, images: bool, driver: bool, without: str) -> None:
    """Refuse to go on where no pictures can be made.

    Args:
        video: Whether videos are written.
        images: Whether png images are.
        driver: Whether this process draws them.
        without: What to leave out then, in words.

    Raises:
        MissingPackageError: If a package that writes them is not installed.
        SimulationError: If there is no usable Vulkan driver.
    """
    if video and find_spec("imageio_ffmpeg") is None:
        raise MissingPackageError(f"videos need imageio and ffmpeg: {INSTALL}")
    if images and find_spec("PIL") is None:
        raise MissingPackageError(f"png images need pillow: {INSTALL}")
    if driver and (problem := vulkan_problem()):
        raise SimulationError(f"no pictures can be drawn here: {problem}; export without {without}")


class Drawing:
    """The pictures of an episode as it was recorded; iterating draws them, moment by moment.

    The actions are played, so that what is no part of a state is there too, and pictures are those
    of ``obs_mode="rgb"`` to the last bit. Where the world does not follow the recording to the last
    bit, it is put into the recorded state, from which links of robots are within a micrometre of
    where they were.

    Attributes:
        exact: Whether the world followed the recording to the last bit, as far as it was drawn.
    """

    def __init__(
        self, task: TaskEnv, columns: Columns, shots: Shots, *, last: bool = False
    ) -> None:
        """Prepare to draw.

        Args:
            task: Made with ``render_mode="rgb_array"``.
            columns: The episode, of T steps.
            shots: What is drawn of every moment.
            last: Whether the state after the last step is drawn as well: T + 1 moments, not T.

        Raises:
            TrajectoryError: If the recording does not say with which seed the episode began.
        """
        if columns.seed is None:
            raise TrajectoryError(
                f"episode {columns.episode_id} names no seed, without which its scene cannot be"
                " built; export without pictures"
            )
        self._task, self._columns, self._shots, self._seed = task, columns, shots, columns.seed
        self._moments = len(columns) + last
        self.exact = True

    def __len__(self) -> int:
        """Return the number of moments."""
        return self._moments

    def __iter__(self) -> Iterator[Frame]:
        """Play and draw."""
        task, actions = self._task, open_loop(self._columns.actions)
        happening = moments(task, self._seed, actions, len(self) - 1)
        next(happening)
        take = _taker(self._shots, task.simulation)
        for t in range(len(self)):
            if not _is_in_state(task, self._columns.states, t):
                task.set_state_dict(state_row(self._columns.states, t))
                self.exact = False
            yield take()
            next(happening, None)


def _is_in_state(task: TaskEnv, states: States, t: int) -> bool:
    current = task.get_state_dict()
    return all(
        np.array_equal(current[kind][name].numpy(), row)
        for kind, rows in state_row(states, t).items()
        for name, row in rows.items()
    )


def _taker(shots: Shots, simulation: Simulation) -> Callable[[], Frame]:
    """Return what takes all pictures of the present moment."""
    channels = shots.channels
    whole = Cameras(simulation, *shots.viewpoint) if shots.viewpoint else None
    observers = Observers(simulation, shots.cameras, shots.textures) if shots.cameras else None

    def take() -> Frame:
        taken: dict[tuple[str, str], Picture] = {}
        if whole is not None:
            taken[OVERVIEW, RGB] = whole.take()[0]
        if observers is not None:
            for name, view in observers.look(0).items():
                for texture, image in view.images.items():
                    taken[name, texture] = np.ascontiguousarray(image)
        return {
            channel: _expected(taken[channel.camera, channel.texture], channel)
            for channel in channels
        }

    return take


def _expected(picture: Picture, channel: Channel) -> Picture:
    if picture.shape != channel.shape or picture.dtype != channel.dtype:
        raise SimulationError(
            f"a picture of {channel.camera} has shape {picture.shape} and type {picture.dtype};"
            f" {channel.shape} and {np.dtype(channel.dtype)} were asked for"
        )
    return picture
