"""Writes a recording anew, as a dataset that a training tool reads."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.core.bounds import checked_whole, shown
from robot_layouts.core.cli import Count, Folder, Word
from robot_layouts.core.commands import UsageError
from robot_layouts.core.importing import optional
from robot_layouts.core.pages import plural
from robot_layouts.core.progress import Progress as ProgressLine
from robot_layouts.core.writing import PARTIAL, claim, writing_errors, written_whole
from robot_layouts.data.export.columns import (
    ColumnReader,
    Columns,
    Credits,
    DatasetWriter,
    succeeded,
)
from robot_layouts.data.export.push import (
    DatasetPush,
    Repository,
    Sharing,
    checked_name,
    report_push,
)
from robot_layouts.data.playing.command_options import (
    PictureSize,
    Players,
    RecordingPath,
    stop_signals,
)
from robot_layouts.data.playing.executor import ProcessExecutor
from robot_layouts.data.point_clouds import Box, point_cloud
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_class, task_for
from robot_layouts.data.reading.recording import Recording, Trajectory
from robot_layouts.simulation.rendering import drawing_problem
from robots import (
    RecordingError,
    SimulationError,
    TaskError,
    UnknownNameError,
)
from tasks.description import instruction_of
from tasks.engine.cameras import checked_size
from tasks.engine.columns import OVERVIEW

if TYPE_CHECKING:
    from robot_layouts.data.export.drawing import Drawing, DrawnEpisode
    from robot_layouts.data.export.shots import Shots
    from robot_layouts.data.playing.executor import Executor
FORMATS = ("lerobot", "robomimic")

BoxCorners = Annotated[
    tuple[float, float, float, float, float, float],
    Word(("X_MIN", "Y_MIN", "Z_MIN", "X_MAX", "Y_MAX", "Z_MAX")),
]

Progress = Callable[[float, int], None]
Draw = Callable[[Columns], "Drawing | DrawnEpisode | None"]


@contextmanager
def new_folder(path: Path) -> Generator[Path]:
    """Make a folder whose content is complete.

    What exports to the same folder left behind when they were killed is removed first.

    Args:
        path: The folder; it may be there already if it is empty; see `refuse_used`.

    Yields:
        A folder beside it to write into, which takes its place at the end.

    Raises:
        RecordingError: If the folder cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    with writing_errors(path, RecordingError):
        partial.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(path)
        lock = claim(partial)
        if lock is None:
            raise RecordingError(f"another process is writing {partial}")
        try:
            with written_whole(path, RecordingError, partial=partial):
                yield partial
        finally:
            os.close(lock)


def refuse_used(path: Path) -> None:
    """Refuse a path at which something is already, other than an empty folder.

    Raises:
        RecordingError: If so.
    """
    with writing_errors(path, RecordingError):
        try:
            used = any(path.iterdir())
        except FileNotFoundError:
            return
        except NotADirectoryError as error:
            raise RecordingError(f"{path} is a file; a folder's name is needed") from error
    if used:
        raise RecordingError(f"{path} is not empty; choose another folder, or empty it")


def _remove_abandoned(path: Path) -> None:
    """Remove the unfinished folders of processes that have ended; the others lock theirs."""
    unfinished = re.compile(rf"\.{re.escape(path.name)}\.[0-9]+\.partial")
    for entry in list(os.scandir(path.parent)):
        if unfinished.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
            lock = claim(Path(entry.path), certain=True)
            if lock is not None:
                shutil.rmtree(entry.path, ignore_errors=True)
                os.close(lock)


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """What a dataset holds, of those of its options that are words on a command line, too.

    Attributes:
        fps: Steps per second to state (default: the task's, 20; lerobot).
        video: Draw every step as well, as videos (lerobot; needs a graphics driver): what the
            overview sees, unless cameras are named.
        images: Write png images, which lose nothing, in place of videos (lerobot).
        depth: Write the cameras' depth as well (mm, 16 bits; for lerobot always as png images).
        size: Width and height of the pictures in pixels (each camera's own).
        points: Write N points of what the recording's cameras observed (robomimic).
        points_frame: Measure them, and their box, from the base of this robot (the world).
        include_failures: Export episodes whose last step is no success, too.
        task: The recording's task; MODULE:ID for one of your own.
    """

    fps: int | None = None
    video: bool = False
    images: bool = False
    depth: bool = False
    size: PictureSize | None = None
    points: Count | None = None
    points_frame: Annotated[str, Word("PLACE")] | None = None
    include_failures: bool = False
    task: str | None = None


@dataclass(frozen=True)
class Export(ExportOptions):
    """What is exported, and as what.

    Attributes:
        recording: An h5 file, ours or native's, with its json beside it, or a recording's folder.
        format: ``"lerobot"`` or ``"robomimic"``.
        out: Folder of the dataset; it must be new or empty.
        layout: Where its robots stood, where the recording cannot say it.
        robots: Which robots these were, where the recording cannot say it.
        cameras: Which cameras' pictures are drawn: names by place such as ``"base_camera"`` and
            ``"left.hand_camera"``, ``"overview"``, or ``"all"`` for those of the task and its
            robots. Videos in a LeRobot dataset, arrays in a robomimic one.
        instruction: What is to be done, in a sentence: of all episodes, or by ``episode_id``. Those
            without have their source's (``"instruction"`` in `Trajectory.source`), else their
            task's.
        points_box: Which points: the lowest and the highest corner of a box (m); None: all. See
            `robot_layouts.data.point_clouds.point_cloud`.
    """

    recording: str | PathLike[str]
    format: str
    out: str | PathLike[str]
    layout: Layout | None = field(default=None, kw_only=True)
    robots: Mapping[str, RobotLike] | None = field(default=None, kw_only=True)
    cameras: str | Sequence[str] | None = field(default=None, kw_only=True)
    instruction: str | Mapping[int, str] | None = field(default=None, kw_only=True)
    points_box: Box | None = field(default=None, kw_only=True)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Which cameras' pictures are drawn; none if there are no pictures."""
        if self.cameras is None:
            return (OVERVIEW,) if self.video else ()
        return (self.cameras,) if isinstance(self.cameras, str) else tuple(self.cameras)

    def check(self) -> None:
        """Refuse what cannot be done.

        Raises:
            UnknownNameError: If there is no such format.
            TaskError: If options do not go together.
            MissingPackageError: If a package that they need is not installed.
            RecordingError: If the folder holds something already.
        """
        self.check_options()
        refuse_used(Path(self.out))

    def check_options(self) -> None:
        """Refuse what cannot be done wherever it is to be written; see `check`."""
        if self.format not in FORMATS:
            raise UnknownNameError("export format", self.format, FORMATS)
        if self.fps is not None and self.fps < 1:
            raise TaskError(f"fps is {self.fps}; it must be 1 or more")
        if self.format == "lerobot":
            optional("pyarrow", "LeRobot datasets need pyarrow", "export")
        if self.format == "robomimic":
            self._expect_robomimic()
        self._expect_points()
        self._expect_pictures()

    def _expect_robomimic(self) -> None:
        for what in ("video", "images", "fps"):
            if getattr(self, what) not in (None, False):
                words = "" if what == "fps" else "cameras, whose pictures it holds, or "
                raise TaskError(
                    f"a robomimic dataset has no {what} here; leave it out, or choose"
                    f" {words}lerobot"
                )

    def _expect_points(self) -> None:
        if self.points is None:
            if self.points_box is not None or self.points_frame is not None:
                raise TaskError("points_box and points_frame are of no use without points")
            return
        checked_whole("points", self.points, 1, None, TaskError)
        if self.format != "robomimic":
            raise TaskError(
                "a LeRobot dataset has no points here: its columns are vectors and pictures; choose"
                " robomimic, or take point_cloud of the recording's observations"
            )

    def _expect_pictures(self) -> None:
        names = self.camera_names
        if not all(isinstance(name, str) for name in names):
            raise TaskError(f"cameras are {shown(self.cameras)}; their names are needed")
        if self.cameras is None:
            for what in ("images", "depth", "size"):
                if getattr(self, what) not in (None, False):
                    raise TaskError(f"{what} is of no use without cameras; choose some, or 'all'")
        elif not names:
            raise TaskError("no camera is named; leave cameras out, or name some")
        if self.video and self.images:
            raise TaskError("pictures are either a video or images; choose one of them")
        if self.size is not None:
            checked_size("size", self.size)
        if names and self.format == "lerobot":
            if not self.images:
                optional("imageio_ffmpeg", "videos need imageio and ffmpeg", "video")
            if self.images or self.depth:
                optional("PIL", "png images need pillow", "video")

    def expect_driver(self, simulator: str) -> None:
        """Refuse pictures if a simulator draws none on this machine.

        Raises:
            SimulationError: If pictures are wanted and it has no usable driver.
        """
        if self.camera_names and (problem := drawing_problem(simulator)):
            without = "video" if self.cameras is None else "cameras"
            raise SimulationError(
                f"no pictures can be drawn here: {problem}; export without {without}"
            )


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
        SimulationError: If there is no driver to draw pictures with.
        WorkerError: If workers cannot be started, or die again and again.
        AssetError: If robot files cannot be found.
    """
    out, progress = Path(wanted.out), _rising(progress)
    wanted.check()
    with Recording(wanted.recording) as file:
        if executor is None or isinstance(executor, ProcessExecutor):  # others say so themselves
            wanted.expect_driver(file.simulator)
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
                    columns = work.columns(i, trajectory)
                    watch = _part(progress, i, len(columns) + 1, len(file))
                    drawn = draw(columns)
                    writer.add(columns, drawn or (), watch, work.text(trajectory))
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

    def columns(self, number: int, trajectory: Trajectory) -> Columns:
        """Return the columns of an episode.

        Raises:
            TrajectoryError: If it lacks states, or points are asked for and nothing was observed.
        """
        columns, wanted = self.reader.read(trajectory), self._wanted
        if wanted.points is None:
            return columns
        if (observed := self._file.observations(number)) is None:
            raise TrajectoryError(
                f"episode {trajectory.episode_id} was recorded without observations, of which"
                " points are made; `robot-layouts replay --obs-mode pointcloud` adds them"
            )
        place = wanted.points_frame
        frame = None if place is None else self.reader.base_poses(columns, place)
        cloud = point_cloud(observed, wanted.points, box=wanted.points_box, frame=frame)
        return replace(columns, points=cloud)

    def text(self, trajectory: Trajectory) -> str | None:
        """Return what is to be done in an episode; None if no text is given.

        The task's own is given with pictures alone, as robomimic datasets of old held none.
        """
        given = self._wanted.instruction
        if isinstance(given, Mapping):
            given = given.get(trajectory.episode_id)
        said = given or (trajectory.source or {}).get("instruction")
        if isinstance(said, str):
            return said
        cls = self.reader.task.task_class
        several = isinstance(cls.instruction, tuple)
        return instruction_of(cls, trajectory.seed or 0) if several or self.seen else None

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
            from robot_layouts.data.export.drawing import Drawing

            yield lambda columns: Drawing(task, columns, shots, last=last)
            return
        from robot_layouts.data.export.drawing import DrawingJob, draw_in_order

        numbers = [i for i in range(len(file)) if wanted.include_failures or succeeded(file[i])]
        making = {"layout": wanted.layout, "robots": wanted.robots, "pictures": True}
        job = DrawingJob.of(file, {i: i for i in numbers}, making, shots=shots, last=last)
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


def export_command(
    recording: RecordingPath,
    *,
    format: Annotated[str, Word("FORMAT")],
    out: Folder,
    cameras: Sequence[Annotated[str, Word("NAME")]] | None = None,
    instruction: Annotated[str, Word("TEXT")] | None = None,
    points_box: BoxCorners | None = None,
    only_successes: bool = False,
    options: ExportOptions,
    push_to_hub: Repository | None = None,
    sharing: Sharing,
    players: Players,
) -> None:
    """Write a recording as a dataset for LeRobot or robomimic.

    The dataset appears when it is complete. Exit code: 0 if it was written, 1 if not, 2 for bad
    usage.

    Args:
        recording: An h5 file, a recording's folder, or one on the Hub.
        format: Format of the dataset: lerobot or robomimic.
        out: New folder for the dataset.
        cameras: Draw what these cameras see, as videos (lerobot) or arrays (robomimic): all,
            overview, or by place: base_camera, left.hand_camera.
        instruction: What the policy is to do, in words (the task's own).
        points_box: Only points in a box: its lowest and its highest corner (m).
        only_successes: What happens anyway.
        options: What the dataset holds.
        push_to_hub: Push it to the Hugging Face Hub, with a card; see `data push`.
        sharing: How it is shared there.
        players: Who plays.

    Raises:
        RobotLayoutsError: If the export fails; see `export`.
    """
    if options.include_failures and only_successes:
        raise UsageError("--include-failures and --only-successes contradict each other")
    wanted = Export(
        recording,
        format,
        out,
        cameras=cameras,
        instruction=instruction,
        points_box=None if points_box is None else (points_box[:3], points_box[3:]),
        **vars(options),
    )
    if push_to_hub is not None:
        checked_name(push_to_hub, sharing)
    elif sharing != Sharing():
        raise UsageError("--licence and --private are of no use without --push-to-hub")
    in_process = players.workers == 0 and players.ray is None
    executor = None if in_process else players.executor()
    with ProgressLine(unit="episodes") as line, stop_signals():

        def show(done: float, total: int) -> None:
            line.total = total
            line.update(round(done, 1), f"exporting {recording.name}")

        done = export(wanted, show, executor=executor, tell=line.say)
    left_out = ""
    if done.left_out:
        failures = plural(done.left_out, "episode")
        left_out = f"; left out: {failures} without success (--include-failures exports them)"
    print(f"{done.folder}: {plural(done.episodes, 'episode')}, {done.steps} steps{left_out}")
    if push_to_hub is not None:
        report_push(DatasetPush.of(out, push_to_hub, sharing))
