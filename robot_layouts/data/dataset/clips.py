"""Small clips of some episodes of a recording, for a page."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_layouts.data.dataset.contents import Contents
from robot_layouts.data.reading.recording import Recording, Trajectory
from robot_layouts.data.video import Picture, open_video, play_pictured
from tasks import TaskEnv
from tasks.episode import Episode

STRIDE = 2  # control steps from one picture to the next


@dataclass(frozen=True)
class Clip:
    """An episode as it looks.

    Attributes:
        place: Its place in the recording.
        seed: Its seed.
        words: What is special about it.
        video: An mp4 file's bytes.
        poster: A jpeg's bytes: the last picture.
    """

    place: int
    seed: int
    words: str
    video: bytes
    poster: bytes


def chosen_places(contents: Contents, most: int) -> dict[int, str]:
    """Return places of episodes that are worth showing, each with what is special about it."""
    steps, order = contents.steps, np.argsort(contents.steps, kind="stable")
    failed = np.flatnonzero(~contents.success)
    named = [
        (0, "the first"),
        *((int(place), "no success") for place in failed[:1]),
        (int(order[-1]), "the longest"),
        (int(order[0]), "the shortest"),
        (int(order[len(order) // 2]), "of median length"),
        *((int(i), "") for i in np.linspace(0, len(steps) - 1, most + 2)[1:-1]),
    ]
    found: dict[int, str] = {}
    for place, words in named:
        found.setdefault(place, words)
    return dict(list(found.items())[:most])


def film(
    file: Recording,
    task: TaskEnv,
    places: dict[int, str],
    progress: Callable[[], None] = lambda: None,
) -> list[Clip]:
    """Return clips, 256 pixels wide, of episodes that have a seed.

    Args:
        file: The recording.
        task: Its task, made to be drawn.
        places: Which episodes, by their place in the recording, each with words on it.
        progress: Called after each.

    Raises:
        MissingPackageError: If imageio is not installed.
        SimulationError: If nothing can be drawn here.
    """
    clips: list[Clip] = []
    for place, words in places.items():
        trajectory = file[place]
        if trajectory.seed is not None:
            clips.append(Clip(place, trajectory.seed, words, *_film_one(task, trajectory)))
        progress()
    return clips


def _film_one(task: TaskEnv, trajectory: Trajectory) -> tuple[bytes, bytes]:
    """Return an mp4 file's bytes, and those of a jpeg of the last picture."""
    import imageio.v2 as imageio

    pictures: list[Picture] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        with open_video(path, task.scenario.control_frequency / STRIDE) as append:

            def take(step: int, picture: Picture) -> None:
                pictures[:] = [_halved(picture)]
                append(pictures[0])

            episode = Episode(trajectory.seed or 0, trajectory.actions)
            play_pictured(task, episode, take, STRIDE)
        video = path.read_bytes()
    poster = io.BytesIO()
    imageio.imwrite(poster, pictures[0], format="jpg")  # pyright: ignore[reportArgumentType]
    return video, poster.getvalue()


def _halved(picture: Picture) -> Picture:
    """Return a picture of half the size, (H, W, 3)."""
    height, width, _ = picture.shape
    squares = picture.reshape(height // 2, 2, width // 2, 2, 3)
    return squares.mean(axis=(1, 3)).round().astype(np.uint8)
