"""Draws recorded episodes, moment by moment, in this process or in workers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_layouts.core.processes.worker import report
from robot_layouts.data.export.columns import ColumnReader, Columns, state_row
from robot_layouts.data.export.shots import RGB, Frame, Picture, PictureChannel, Shots
from robot_layouts.data.playing.executor import Executor, play_all
from robot_layouts.data.playing.replay import RecordedJob
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Trajectory
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.rendering import Cameras, Observers
from tasks import TaskEnv
from tasks.engine.columns import OVERVIEW
from tasks.episode import States, moments, open_loop


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
        return {channel: taken[channel.camera, channel.texture] for channel in channels}

    return take


@dataclass(frozen=True)
class DrawnEpisode:
    """The pictures of an episode; iterating gives them moment by moment.

    Attributes:
        pictures: PictureChannel → its pictures, (moments, height, width, k).
        exact: See `robot_layouts.data.export.drawing.Drawing`.
    """

    pictures: Mapping[PictureChannel, Picture]
    exact: bool

    def __iter__(self) -> Iterator[Frame]:
        """Give all pictures of one moment after the other."""
        for moment in zip(*self.pictures.values(), strict=True):
            yield dict(zip(self.pictures, moment, strict=True))


@dataclass(frozen=True)
class DrawingJob(RecordedJob):
    """Episodes of a recording that are drawn, each in a world that is built anew.

    Attributes:
        shots: What is drawn of every moment.
        last: Whether the state after the last step is drawn as well.
    """

    shots: Shots
    last: bool

    def tools(self, task: TaskEnv) -> ColumnReader:
        """Return what reads the episodes' columns."""
        return ColumnReader(task)

    def play(self, task: TaskEnv, episode: Trajectory, tools: ColumnReader) -> DrawnEpisode:
        """Draw an episode."""
        drawing = Drawing(task, tools.read(episode), self.shots, last=self.last)
        pictures = {
            channel: np.empty((len(drawing), *channel.shape), channel.dtype)
            for channel in self.shots.channels
        }
        for moment, frame in enumerate(drawing):
            for channel, picture in frame.items():
                pictures[channel][moment] = picture
            report((moment + 1) / len(drawing))
        return DrawnEpisode(pictures, drawing.exact)


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


def _take_back(path: Path, channels: Sequence[PictureChannel]) -> DrawnEpisode:
    with np.load(path) as file:
        pictures = {channel: file[str(i)] for i, channel in enumerate(channels)}
        episode = DrawnEpisode(pictures, bool(file["exact"]))
    path.unlink()
    return episode
