"""Films episodes: plays them once more in worlds that can be drawn, and writes an mp4."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.importing import optional
from robot_layouts.core.writing import PARTIAL, written_whole
from robot_layouts.simulation.rendering import Cameras, drawing_problem
from robots import RecordingError
from tasks import TaskEnv
from tasks.engine.columns import overview
from tasks.episode import Episode, play

Picture = NDArray[np.uint8]  # (H, W, 3)

STILL_FRAMES = 12  # of the last picture of an episode, before the next begins
INSTALL = "pip install 'robot-layouts[video]'"


def video_problem(simulator: str) -> str | None:
    """Say in a few words why a simulator's pictures make no video here, or return None."""
    return package_problem() or drawing_problem(simulator)


def package_problem() -> str | None:
    """Say which packages that write videos are missing here, or return None."""
    missing = [name for name in ("imageio", "imageio_ffmpeg") if find_spec(name) is None]
    return f"{' and '.join(missing)} not installed; {INSTALL}" if missing else None


def film(
    task: TaskEnv,
    episodes: Sequence[Episode],
    path: Path,
    *,
    seconds: float = float("inf"),
    progress: Callable[[int, int], None] = lambda frame, total: None,
) -> int:
    """Write a video of episodes, one after the other, at the speed at which they happen.

    Args:
        task: Made with ``render_mode="rgb_array"``, with one environment.
        episodes: What to show; at least one.
        path: The mp4 file; it appears when it is whole.
        seconds: Time after which no further episode is begun if it would end later (s).
        progress: Called after each frame with its number in the episode and the episode's frames.

    Returns:
        How many of the episodes, counted from the first, it shows.

    Raises:
        MissingPackageError: If imageio is not installed.
        RecordingError: If the file cannot be written.
    """
    start, shown = perf_counter(), 0
    with open_video(path, task.scenario.control_frequency) as append:
        for episode in episodes:
            if shown and (perf_counter() - start) * (shown + 1) / shown > seconds:
                break
            last = len(episode.actions)

            def take(step: int, picture: Picture, last: int = last) -> None:
                for _ in range(1 + STILL_FRAMES * (step == last)):
                    append(picture)
                progress(step + 1, last + 1)

            play_pictured(task, episode, take)
            shown += 1
    return shown


def play_pictured(
    task: TaskEnv, episode: Episode, take: Callable[[int, Picture], None], stride: int = 1
) -> None:
    """Play an episode, and take a picture after the reset and after every few steps.

    Args:
        task: Made with ``render_mode="rgb_array"``, with one environment.
        episode: What is played.
        take: Called with the number of the step, 0 being the reset, and the picture, (H, W, 3).
        stride: Steps from one picture to the next.
    """
    eye, target = overview(task.layout) or task.viewpoint
    steps = count()

    def watch() -> None:
        if (step := next(steps)) % stride == 0:
            take(step, Cameras(task.simulation, eye, target).take()[0])

    play(task, episode.seed, episode.actions, watch)


@contextmanager
def open_video(path: Path, frames_per_second: float) -> Generator[Callable[[Picture], None]]:
    """Write an mp4 (h264) picture by picture; it appears when it is whole.

    Args:
        path: The file.
        frames_per_second: Pictures per second.

    Yields:
        What takes the next picture, (H, W, 3), H and W multiples of 16.

    Raises:
        MissingPackageError: If imageio is not installed.
        RecordingError: If the file cannot be written.
    """
    partial = path.with_name(f"{path.stem}.{os.getpid()}{PARTIAL}{path.suffix}")
    imageio = optional("imageio.v2", "videos need imageio", "video")
    settings = {"fps": frames_per_second, "quality": 8, "macro_block_size": 16}
    with (
        written_whole(path, RecordingError, partial=partial),
        imageio.get_writer(partial, **settings) as writer,
    ):
        yield writer.append_data
