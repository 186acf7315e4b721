"""Writes a recording anew, as a dataset that a training tool reads."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Any

from layouts import Layout
from layouts.placement import RobotLike
from robots import MissingPackageError, TaskError, UnknownNameError
from rollouts.export.columns import ColumnReader, Columns, succeeded
from rollouts.export.credits import Credits
from rollouts.export.folder import new_folder, refuse_used
from rollouts.reading.recorded_task import task_class, task_for
from rollouts.reading.trajectory import TrajectoryError, TrajectoryFile
from tasks.description import read_docstring

FORMATS = ("lerobot", "robomimic")
INSTALL = "pip install 'robot-layouts[export]'"

Progress = Callable[[float, int], None]
AddEpisode = Callable[[Columns, Callable[[int], None]], None]


@dataclass(frozen=True)
class Export:
    """What is exported, and as what.

    Attributes:
        recording: The h5 file, ours or native's, with its json beside it.
        format: ``"lerobot"`` or ``"robomimic"``.
        out: Folder of the dataset; it must be new or empty.
        fps: Control steps per second that the dataset states (``"lerobot"`` only); those of the
            task if None.
        video: Whether pictures of the episodes are drawn (``"lerobot"`` only).
        only_successes: Whether episodes whose last step is no success are left out.
        task: The recording's task; ``module:Id`` for one of a module that no package lists.
        layout: Where its robots stood, where the recording cannot say it.
        robots: Which robots these were, where the recording cannot say it.
    """

    recording: str | PathLike[str]
    format: str
    out: str | PathLike[str]
    fps: int | None = None
    video: bool = False
    only_successes: bool = False
    task: str | None = None
    layout: Layout | None = None
    robots: Mapping[str, RobotLike] | None = None


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


def export(wanted: Export, progress: Progress = lambda done, total: None) -> Exported:
    """Write a dataset; it appears when it is complete.

    Args:
        wanted: What to export.
        progress: Called with the episodes done, fractions included, and those there are.

    Raises:
        UnknownNameError: If there is no such format, task or robot.
        TrajectoryError: If the recording cannot be read, holds no states, or no episode is left.
        RecordingError: If the dataset cannot be written, or its folder holds something already.
        MissingPackageError: If a package that the format needs is not installed.
        TaskError: If the options do not go together.
        SimulationError: If there is no Vulkan driver to draw pictures with.
        AssetError: If robot files cannot be found.
    """
    out = Path(wanted.out)
    _check(wanted, out)
    with TrajectoryFile(wanted.recording) as file:
        if not len(file):
            raise TrajectoryError(f"{file.path} holds no episodes; there is nothing to export")
        task_class(file, wanted.task)
        task = task_for(file, layout=wanted.layout, robots=wanted.robots, pictures=wanted.video)
        reader = ColumnReader(task, Credits(file))
        episodes = steps = 0
        with new_folder(out) as folder, _writer(wanted, folder, file, reader) as add:
            for i, trajectory in enumerate(file):
                if not wanted.only_successes or succeeded(trajectory):
                    columns = reader.read(trajectory)
                    add(columns, _part(progress, i, len(columns), len(file)))
                    episodes, steps = episodes + 1, steps + len(columns)
                progress(i + 1, len(file))
            if not episodes:
                raise TrajectoryError(f"none of the {len(file)} episodes of {file.path} succeeded")
        return Exported(out, episodes, steps, len(file) - episodes)


@contextmanager
def _writer(
    wanted: Export, folder: Path, file: TrajectoryFile, reader: ColumnReader
) -> Generator[AddEpisode]:
    """Yield a function that writes an episode and tells how many pictures it has drawn."""
    origin = _origin(file, reader)
    if wanted.format == "robomimic":
        from rollouts.export.robomimic import RobomimicWriter

        with RobomimicWriter(folder, reader, origin=origin) as robomimic:
            yield lambda columns, watch: robomimic.add(columns)
        return
    from rollouts.export.lerobot import LeRobotWriter
    from rollouts.export.pictures import draw

    text = read_docstring(type(reader.task)).summary
    fps = wanted.fps or _whole(reader.task.scenario.control_frequency)
    with LeRobotWriter(folder, reader, task_text=text, fps=fps, origin=origin) as lerobot:
        yield lambda columns, watch: lerobot.add(
            columns, draw(reader.task, columns) if wanted.video else None, watch
        )


def _check(wanted: Export, out: Path) -> None:
    """Refuse what cannot be done before anything is read."""
    if wanted.format not in FORMATS:
        raise UnknownNameError("export format", wanted.format, FORMATS)
    if wanted.fps is not None and wanted.fps < 1:
        raise TaskError(f"fps is {wanted.fps}; it must be 1 or more")
    if wanted.format == "lerobot" and find_spec("pyarrow") is None:
        raise MissingPackageError(f"LeRobot datasets need pyarrow: {INSTALL}")
    if wanted.format == "robomimic" and (wanted.video or wanted.fps is not None):
        what = "video" if wanted.video else "fps"
        raise TaskError(f"a robomimic dataset has no {what} here; leave it out, or choose lerobot")
    if wanted.video:
        from rollouts.export.pictures import require_pictures

        require_pictures()
    refuse_used(out)


def _whole(frequency: float) -> int:
    if frequency != int(frequency):
        raise TaskError(f"the task runs at {frequency} Hz; give a whole number as fps")
    return int(frequency)


def _part(progress: Progress, done: int, pictures: int, total: int) -> Callable[[int], None]:
    """Return what tells of pictures drawn, of those of the episode after ``done`` episodes."""
    return lambda drawn: progress(done + drawn / pictures, total)


def _origin(file: TrajectoryFile, reader: ColumnReader) -> dict[str, Any]:
    actors = reader.credits.actors if reader.credits else []
    return {
        "task_id": file.task_id,
        "control_mode": file.control_mode,
        "source_type": file.source_type,
        "layout": file.layout,
        **({"actors": actors} if actors else {}),
    }
