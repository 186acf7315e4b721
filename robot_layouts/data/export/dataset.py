"""Writes a recording anew, as a dataset that a training tool reads."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_layouts.data.export.columns import ColumnReader, Columns, Credits, succeeded
from robot_layouts.data.export.folder import new_folder
from robot_layouts.data.export.options import FORMATS, Export
from robot_layouts.data.playing.executor import ProcessExecutor
from robot_layouts.data.reading.recorded_task import task_class, task_for
from robot_layouts.data.reading.recording import Recording, Trajectory, TrajectoryError
from robots import TaskError
from tasks.description import instruction_of

if TYPE_CHECKING:
    from robot_layouts.data.export.drawing_job import DrawnEpisode
    from robot_layouts.data.export.pictures import Drawing
    from robot_layouts.data.export.shots import Shots
    from robot_layouts.data.export.writer import DatasetWriter
    from robot_layouts.data.playing.executor import Executor

__all__ = ["FORMATS", "Export", "Exported", "export"]

Progress = Callable[[float, int], None]
Draw = Callable[[Columns], "Drawing | DrawnEpisode | None"]


@dataclass(frozen=True)
class Exported:
    """What an export wrote.

    Attributes:
        folder: The dataset.
        episodes: Number of episodes.
        steps: Number of steps of all of them.
        left_out: Episodes of the recording that are not in it.
    """

    folder: Path
    episodes: int
    steps: int
    left_out: int


def export(
    wanted: Export,
    progress: Progress = lambda done, total: None,
    *,
    executor: Executor | None = None,
    tell: Callable[[str], None] = lambda text: None,
) -> Exported:
    """Write a dataset; it appears when it is complete.

    Its bytes do not depend on who draws.

    Args:
        wanted: What to export.
        progress: Called with the episodes done, fractions included, and those there are.
        executor: Who draws the pictures, such as `ProcessExecutor`; None:
            this process.
        tell: Called with what happens to workers, in words.

    Raises:
        UnknownNameError: If there is no such format, task, robot or camera.
        TrajectoryError: If the recording cannot be read, holds no states or does not say which
            episodes succeeded, or no episode is left.
        RecordingError: If the dataset cannot be written, or its folder holds something already.
        MissingPackageError: If a package that the format needs is not installed.
        TaskError: If the options do not go together.
        SimulationError: If there is no Vulkan driver to draw pictures with.
        WorkerError: If workers cannot be started, or die again and again.
        AssetError: If robot files cannot be found.
    """
    out, progress = Path(wanted.out), _rising(progress)
    wanted.check(here=executor is None or isinstance(executor, ProcessExecutor))
    with Recording(wanted.recording) as file:
        if not len(file):
            raise TrajectoryError(f"{file.path} holds no episodes; there is nothing to export")
        work = _Work(wanted, file, here=executor is None)
        episodes = steps = 0
        with (
            new_folder(out) as folder,
            work.writer(folder) as writer,
            work.artist(folder, executor, progress, tell) as draw,
        ):
            for i, trajectory in enumerate(file):
                if wanted.include_failures or succeeded(trajectory):
                    columns = work.reader.read(trajectory)
                    watch = _part(progress, i, len(columns) + 1, len(file))
                    drawn = draw(columns)
                    writer.add(columns, drawn or (), watch, text=work.text(trajectory))
                    if drawn is not None and work.seen:
                        writer.note({"pictures_exact": drawn.exact})
                    episodes, steps = episodes + 1, steps + len(columns)
                progress(i + 1, len(file))
            if not episodes:
                raise TrajectoryError(
                    f"none of the {len(file)} episodes of {file.path} succeeded; to export them all"
                    " the same, take include_failures (--include-failures)"
                )
        return Exported(out, episodes, steps, len(file) - episodes)


class _Work:
    """What is to be exported: the columns, the pictures, the texts.

    Attributes:
        reader: Names the columns.
        seen: Whether there are pictures of the task's or its robots' cameras.
    """

    def __init__(self, wanted: Export, file: Recording, *, here: bool) -> None:
        """Make the task; it can be drawn if ``here`` says that this process draws."""
        task_class(file, wanted.task)
        names = wanted.camera_names
        task = task_for(
            file, layout=wanted.layout, robots=wanted.robots, pictures=here and bool(names)
        )
        self.reader, self._wanted, self._file = ColumnReader(task, Credits(file)), wanted, file
        self._shots: Shots | None = None
        if names:
            from robot_layouts.data.export.shots import choose_shots

            self._shots = choose_shots(task, names, size=wanted.size, depth=wanted.depth)
        self.seen = bool(self._shots and self._shots.cameras)
        self._instruction = instruction_of(task.task_class)

    def text(self, trajectory: Trajectory) -> str | None:
        """Return what is to be done in an episode; None if nobody says so or asks.

        The task's own is given with pictures alone, as robomimic datasets of old held none.
        """
        given = self._wanted.instruction
        if isinstance(given, Mapping):
            given = given.get(trajectory.episode_id)
        said = given or (trajectory.source or {}).get("instruction")
        return said if isinstance(said, str) else self._instruction if self.seen else None

    def writer(self, folder: Path) -> DatasetWriter:
        """Return what writes the episodes."""
        task, wanted = self.reader.task, self._wanted
        origin = _origin(self._file, self.reader)
        channels = self._shots.channels if self._shots else []
        if wanted.format == "robomimic":
            from robot_layouts.data.export.robomimic import RobomimicWriter

            return RobomimicWriter(folder, self.reader, origin, channels, size=wanted.size)
        from robot_layouts.data.export.lerobot import LeRobotWriter

        return LeRobotWriter(
            folder,
            self.reader,
            origin,
            channels,
            task_text=self._instruction,
            fps=wanted.fps or _whole(task.scenario.control_frequency),
            images=wanted.images,
        )

    @contextmanager
    def artist(
        self,
        folder: Path,
        executor: Executor | None,
        progress: Progress,
        tell: Callable[[str], None],
    ) -> Generator[Draw]:
        """Yield what draws each episode in its turn; see `export`."""
        shots, wanted, file, task = self._shots, self._wanted, self._file, self.reader.task
        if shots is None:
            yield lambda columns: None
            return
        last = wanted.format == "robomimic"  # which holds what is seen after a step, too
        if executor is None:
            from robot_layouts.data.export.pictures import Drawing

            yield lambda columns: Drawing(task, columns, shots, last=last)
            return
        from robot_layouts.data.export.drawing_job import DrawingJob, draw_in_order

        path = Path(wanted.recording).absolute()
        job = DrawingJob(path, task.task_class, shots, last, wanted.layout, wanted.robots)
        numbers = [i for i in range(len(file)) if wanted.include_failures or succeeded(file[i])]
        episodes = draw_in_order(
            job, executor, numbers, folder, lambda n: progress(n, len(file)), tell
        )
        with closing(episodes) as drawn:
            yield lambda columns: next(drawn)


def _whole(frequency: float) -> int:
    if frequency != int(frequency):
        raise TaskError(f"the task runs at {frequency} Hz; give a whole number as fps")
    return int(frequency)


def _part(progress: Progress, done: int, moments: int, total: int) -> Callable[[int], None]:
    """Return what tells of moments drawn, of those of the episode after ``done`` episodes."""
    return lambda drawn: progress(done + drawn / moments, total)


def _rising(progress: Progress) -> Progress:
    """Return what passes on only what is more than was done before."""
    most = 0.0

    def show(done: float, total: int) -> None:
        nonlocal most
        if done > most:
            most = done
            progress(done, total)

    return show


def _origin(file: Recording, reader: ColumnReader) -> dict[str, Any]:
    actors = reader.credits.actors if reader.credits else []
    return {
        "task_id": file.task_id,
        "control_mode": file.control_mode,
        "source_type": file.source_type,
        "layout": file.layout,
        **({"actors": actors} if actors else {}),
    }
