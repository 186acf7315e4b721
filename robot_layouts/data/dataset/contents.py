"""What a report shows of a recording: what it holds, how near robots came, and clips.

The first is read from the json beside its files. Distances are those of the convex hulls of
collision shapes, whatever the simulation lets overlap; see `robot_layouts.simulation.World`.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout, Placement
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.reading.json_files import EpisodeEntry, describe_source, read_summary
from robot_layouts.data.reading.recording import Recording, all_files
from robot_layouts.data.video import Picture, open_video, play_pictured
from tasks import TaskEnv
from tasks.episode import Episode
from tasks.native.format import articulation_keys

_Columns = tuple[NDArray[np.int64], NDArray[np.bool_], dict[str, NDArray[np.float64]]]
STRIDE = 2  # control steps from one picture to the next


@dataclass(frozen=True)
class FileFacts:
    """One h5 file of a recording.

    Attributes:
        name: Its name.
        megabytes: Its size (MB).
        episodes: How many episodes it holds.
        first: Seed of the first of them, or None.
        last: Seed of the last, or None.
    """

    name: str
    megabytes: float
    episodes: int
    first: int | None
    last: int | None


@dataclass
class SourceFacts:
    """Episodes of one source: how many, how many succeeded, and their control steps."""

    episodes: int = 0
    successes: int = 0
    steps: int = 0


@dataclass
class Contents:
    """What a recording of n episodes holds.

    Attributes:
        task_id: Id of the task.
        control_mode: Control mode of every episode.
        files: Its files.
        steps: Control steps of each episode, (n,).
        success: Whether each ended in success, (n,).
        sources: Counts of each source, by its name.
        drawn: What was varied, by axis and name: a number for each episode, (n,), NaN where
            nothing was drawn.
    """

    task_id: str
    control_mode: str | dict[str, str]
    files: list[FileFacts] = field(default_factory=list[FileFacts])
    steps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    success: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    sources: dict[str, SourceFacts] = field(default_factory=dict[str, SourceFacts])
    drawn: dict[str, NDArray[np.float64]] = field(default_factory=dict[str, Any])

    @property
    def megabytes(self) -> float:
        """Size of all h5 files (MB)."""
        return sum(file.megabytes for file in self.files)


def read_contents(
    path: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> Contents:
    """Return what a recording holds.

    Args:
        path: The recording: an h5 file, a folder or a manifest.
        progress: Called with the files read, and those there are.

    Raises:
        TrajectoryError: If a file's json cannot be read.
    """
    files = all_files(path)
    found: Contents | None = None
    parts: list[_Columns] = []
    for number, file in enumerate(files):
        summary = read_summary(file)
        found = found or Contents(summary.task_id, summary.control_mode)
        seeds = [entry.seed for entry in summary.episodes] or [None]
        size = file.stat().st_size / 1e6 if file.exists() else 0.0
        facts = FileFacts(file.name, size, len(summary.episodes), seeds[0], seeds[-1])
        found.files.append(facts)
        for entry in summary.episodes:
            source = found.sources.setdefault(describe_source(entry, summary), SourceFacts())
            source.episodes += 1
            source.successes += bool(entry.success)
            source.steps += entry.steps or 0
        parts.append(_columns(summary.episodes))
        progress(number + 1, len(files))
    assert found is not None  # there is a file at least
    found.steps = np.concatenate([steps for steps, _, _ in parts])
    found.success = np.concatenate([success for _, success, _ in parts])
    found.drawn = {
        name: np.concatenate([drawn.get(name, np.full(len(s), np.nan)) for s, _, drawn in parts])
        for name in dict.fromkeys(name for _, _, drawn in parts for name in drawn)
    }
    return found


def numbers_of(drawn: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number in what was drawn for an episode, by axis and name."""
    if isinstance(drawn, Mapping):
        for key, value in drawn.items():
            yield from numbers_of(value, f"{name}/{key}".lstrip("/"))
    elif isinstance(drawn, list):
        for i, value in enumerate(drawn):
            yield from numbers_of(value, f"{name}[{i}]")
    elif isinstance(drawn, int | float):
        yield name, float(drawn)


def _columns(episodes: tuple[EpisodeEntry, ...]) -> _Columns:
    """Return steps, success and what was drawn, a number for each episode."""
    steps = np.array([entry.steps or 0 for entry in episodes], np.int64)
    success = np.array([bool(entry.success) for entry in episodes], np.bool_)
    drawn: dict[str, NDArray[np.float64]] = {}
    for number, entry in enumerate(episodes):
        for name, value in numbers_of(entry.drawn or {}):
            if name not in drawn:
                drawn[name] = np.full(len(episodes), np.nan)
            drawn[name][number] = value
    return steps, success, drawn


@dataclass(frozen=True)
class EpisodeClearances:
    """How near robots came in some episodes.

    Attributes:
        places: Which episodes, by their place in the recording.
        least: The least distance of links of different robots in each (m), of all control steps;
            negative where they overlap.
    """

    places: list[int]
    least: NDArray[np.float64]


def measure(
    file: Recording,
    task: TaskEnv,
    places: Sequence[int],
    progress: Callable[[], None] = lambda: None,
) -> EpisodeClearances | None:
    """Return how near robots came; None if there is one alone, or an episode has no states.

    Args:
        file: The recording.
        task: Its task.
        places: Which episodes are measured, by their place in the recording.
        progress: Called after each episode.

    Raises:
        MissingPackageError: If python-fcl is not installed.
    """
    if len(task.layout) < 2:
        return None
    layout, reader, keys = task.layout, ColumnReader(task), articulation_keys(task.layout)
    least = list[float]()
    standing, distance = None, None  # where robots stood in the last episode, and what measures
    for place in places:
        trajectory = file[place]
        if trajectory.states is None:
            return None
        columns = reader.read(trajectory)
        rows = columns.states["articulations"]
        poses = tuple(tuple(rows[keys[name]][0, :7].tolist()) for name in layout)
        if distance is None or poses != standing:
            standing, distance = poses, _between_robots(_moved(layout, poses))
        qpos = np.concatenate([columns.qpos[name] for name in layout], axis=1)
        least.append(float(distance(qpos.astype(float)).min()))
        progress()
    return EpisodeClearances(list(places), np.array(least))


def _moved(layout: Layout, poses: Sequence[Sequence[float]]) -> Layout:
    """Return a layout with robots at other poses, each (x, y, z, w, i, j, k) (m)."""
    moved: dict[str, Placement] = {}
    for (name, placement), pose in zip(layout.items(), poses, strict=True):
        x, y, z = pose[:3]
        w, i, j, k = (np.array(pose[3:]) / np.linalg.norm(pose[3:])).tolist()
        there = {"position": (x, y, z), "quaternion": (w, i, j, k)}
        moved[name] = replace(placement, **there, rpy=None, on=None)
    return Layout(moved)


def _between_robots(layout: Layout) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return what gives the least distance of links of different robots, (n, D) → (n,) (m)."""
    from robot_layouts.motion.collision.cell import Cell
    from robot_layouts.motion.collision.checker import Checker

    cell = Cell(layout)
    movers = np.array([solid.mover for solid in cell.solids])[cell.counted_pairs]
    between = (movers != "").all(axis=1) & (movers[:, 0] != movers[:, 1])
    pairs = cell.counted_pairs[between]
    return Checker(cell, pairs, np.zeros(len(pairs))).distance


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
            episode = Episode(trajectory.seed, trajectory.actions)
            clips.append(Clip(place, trajectory.seed, words, *film_one(task, episode)))
        progress()
    return clips


def film_one(task: TaskEnv, episode: Episode) -> tuple[bytes, bytes]:
    """Return an mp4 file's bytes, 256 pixels wide, and those of a jpeg of the last picture.

    Args:
        task: Made to be drawn, with one environment.
        episode: What is shown.

    Raises:
        MissingPackageError: If imageio is not installed.
        SimulationError: If nothing can be drawn here.
    """
    import imageio.v2 as imageio

    pictures: list[Picture] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        with open_video(path, task.scenario.control_frequency / STRIDE) as append:

            def take(step: int, picture: Picture) -> None:
                pictures[:] = [_halved(picture)]
                append(pictures[0])

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
