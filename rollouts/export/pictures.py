"""Pictures of recorded episodes, and the mp4 files that hold many episodes each."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import MissingPackageError, SimulationError
from rollouts.export.columns import Columns, state_row
from rollouts.reading.trajectory import TrajectoryError
from rollouts.video import INSTALL
from simulation.rendering.pictures import SIZE, Cameras, vulkan_problem
from tasks import MultiRobotTask
from tasks.engine.columns import overview
from tasks.episode import States, follow, moments

SHAPE = (SIZE, SIZE, 3)
CODEC = "h264"
PIXEL_FORMAT = "yuv420p"
# A keyframe every second frame, as LeRobot has them, so that any frame is near one; no frames
# that refer to later ones, so that frame k is shown at k / fps exactly.
ENCODING = ["-g", "2", "-bf", "0", "-crf", "23", "-preset", "veryfast", "-movflags", "+faststart"]


def require_pictures() -> None:
    """Refuse to go on where no video can be made.

    Raises:
        MissingPackageError: If imageio is not installed.
        SimulationError: If there is no usable Vulkan driver.
    """
    try:
        import imageio_ffmpeg  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingPackageError(f"videos need imageio and ffmpeg: {INSTALL}") from None
    if problem := vulkan_problem():
        raise SimulationError(f"no pictures can be drawn here: {problem}; export without video")


def draw(task: MultiRobotTask, columns: Columns) -> Generator[NDArray[np.uint8]]:
    """Draw an episode as it was recorded: the state before each of its T steps.

    The actions are played, so that what is no part of a state is there too. Where the world does
    not follow the recording to the last bit, it is put into the recorded state.

    Args:
        task: Made with ``render_mode="rgb_array"``.
        columns: The episode.

    Yields:
        One picture, (512, 512, 3), per step.

    Raises:
        TrajectoryError: If the recording does not say with which seed the episode began.
    """
    if columns.seed is None:
        raise TrajectoryError(
            f"episode {columns.episode_id} names no seed, without which its scene cannot be built;"
            " export without video"
        )
    happening = moments(task, columns.seed, follow(columns.actions), len(columns) - 1)
    next(happening)
    eye, target = overview(task.layout) or task.viewpoint
    cameras = Cameras(task.simulation, eye, target)
    for t in range(len(columns)):
        _put(task, columns.states, t)
        yield cameras.take()[0]
        next(happening, None)


def _put(task: MultiRobotTask, states: States, t: int) -> None:
    current, recorded = task.get_state_dict(), state_row(states, t)
    same = all(
        np.array_equal(current[kind][name].numpy(), row)
        for kind, rows in recorded.items()
        for name, row in rows.items()
    )
    if not same:
        task.set_state_dict(recorded)


@dataclass
class VideoFile:
    """An mp4 file that is being written.

    Attributes:
        path: The file.
        fps: Frames per second.
        frames: Frames written so far.
    """

    path: Path
    fps: int
    frames: int = 0

    def __post_init__(self) -> None:
        """Begin the file."""
        import imageio.v2 as imageio

        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._writer: Any = imageio.get_writer(
            self.path,
            fps=self.fps,
            codec="libx264",
            quality=None,
            pixelformat=PIXEL_FORMAT,
            output_params=ENCODING,
        )

    @property
    def seconds(self) -> float:
        """Length of what is written so far (s)."""
        return self.frames / self.fps

    @property
    def size(self) -> int:
        """Bytes on disk; the last frames may be on their way."""
        return self.path.stat().st_size if self.path.exists() else 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Write one more frame."""
        self._writer.append_data(picture)
        self.frames += 1

    def close(self) -> None:
        """Finish the file; closing twice is allowed."""
        self._writer.close()
