"""Draws the episodes of a recording in workers, and hands their pictures out in its order."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.export.pictures import Drawing
from robot_layouts.data.export.shots import Channel, Frame, Picture, Shots
from robot_layouts.data.playing.executor import Executor, modules_of, play_all, report
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from tasks import MultiRobotTask


@dataclass(frozen=True)
class DrawnEpisode:
    """The pictures of an episode; iterating gives them moment by moment.

    Attributes:
        pictures: Channel → its pictures, (moments, height, width, k).
        exact: See `robot_layouts.data.export.pictures.Drawing`.
    """

    pictures: Mapping[Channel, Picture]
    exact: bool

    def __iter__(self) -> Iterator[Frame]:
        """Give all pictures of one moment after the other."""
        for moment in zip(*self.pictures.values(), strict=True):
            yield dict(zip(self.pictures, moment, strict=True))


@dataclass(frozen=True)
class DrawingJob:
    """Makes what draws the episodes of a recording, which are numbered as in the file.

    Attributes:
        recording: The h5 file or the recording's folder, where workers can read it.
        task: Class of the task that was recorded; loading it imports its module.
        shots: What is drawn of every moment.
        last: Whether the state after the last step is drawn as well.
        layout: Where its robots stood, where the recording cannot say it.
        robots: Which robots these were, where the recording cannot say it.
    """

    recording: Path
    task: type[MultiRobotTask]
    shots: Shots
    last: bool
    layout: Layout | None = None
    robots: Mapping[str, RobotLike] | None = None

    @property
    def modules(self) -> tuple[str, ...]:
        """The modules that a worker on another machine may need."""
        return modules_of(self.task)

    def __call__(self) -> Callable[[int], DrawnEpisode]:
        """Make the task in a worker, and return what draws an episode by its number.

        Raises:
            RobotLayoutsError: If it cannot be made there, or the recording cannot be read.
        """
        torch.set_num_threads(1)  # the tensors are small, and other workers want the cores
        return _Drawer(self)


class _Drawer:
    """Draws episodes in one world, which is built anew for each."""

    def __init__(self, job: DrawingJob) -> None:
        self._job, self._file = job, Recording(job.recording)
        self._task = task_for(self._file, layout=job.layout, robots=job.robots, pictures=True)
        self._reader = ColumnReader(self._task)

    def __call__(self, number: int) -> DrawnEpisode:
        """Draw an episode."""
        job, columns = self._job, self._reader.read(self._file[number])
        drawing = Drawing(self._task, columns, job.shots, last=job.last)
        pictures = {
            channel: np.empty((len(drawing), *channel.shape), channel.dtype)
            for channel in job.shots.channels
        }
        for moment, frame in enumerate(drawing):
            for channel, picture in frame.items():
                pictures[channel][moment] = picture
            report((moment + 1) / len(drawing))
        return DrawnEpisode(pictures, drawing.exact)

    def close(self) -> None:
        """Let the worlds and the file go."""
        self._task.close()
        self._file.close()


def draw_in_order(
    job: DrawingJob,
    executor: Executor,
    numbers: Sequence[int],
    folder: Path,
    watch: Callable[[float], None],
    tell: Callable[[str], None],
) -> Generator[DrawnEpisode]:
    """Draw episodes in workers, and yield them in their order.

    Args:
        job: What the workers do.
        executor: Starts the workers.
        numbers: Which episodes, in the order in which they are yielded.
        folder: Where those wait that are drawn before their turn; nothing of them is left there.
        watch: Called with the episodes drawn so far, fractions included.
        tell: Called with what happens to workers, in words.

    Raises:
        RobotLayoutsError: If one cannot be drawn, or workers died of it again and again.
    """
    parts: dict[int, float] = {}
    turn = iter(numbers)
    wanted = next(turn, None)
    with closing(play_all(executor, job, numbers)) as events:
        for event in events:
            if event.error is not None:
                raise event.error
            if event.died is not None:
                at = "" if event.seed is None else f" at episode {event.seed}"
                tell(f"{event.died}{at}; another takes its place")
            elif event.seed is None:
                tell(str(event.note))
            elif event.result is None:
                parts[event.seed] = event.note
                watch(sum(parts.values()))
            else:
                parts[event.seed] = 1.0
                watch(sum(parts.values()))
                if event.seed != wanted:
                    _put_aside(_waiting(folder, event.seed), event.result)
                    continue
                yield event.result
                wanted = next(turn, None)
                while wanted is not None and (path := _waiting(folder, wanted)).exists():
                    yield _take_back(path, job.shots.channels)
                    wanted = next(turn, None)


def _waiting(folder: Path, number: int) -> Path:
    return folder / f".drawn_{number}.npz"


def _put_aside(path: Path, episode: DrawnEpisode) -> None:
    pictures = {str(i): pictures for i, pictures in enumerate(episode.pictures.values())}
    np.savez(path, exact=episode.exact, **pictures)  # pyright: ignore[reportArgumentType]


def _take_back(path: Path, channels: Sequence[Channel]) -> DrawnEpisode:
    with np.load(path) as file:
        pictures = {channel: file[str(i)] for i, channel in enumerate(channels)}
        episode = DrawnEpisode(pictures, bool(file["exact"]))
    path.unlink()
    return episode
