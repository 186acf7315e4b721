"""Records the episodes of a recording in another control mode."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from robot_layouts.core.cli import Folder
from robot_layouts.core.commands import printable
from robot_layouts.core.progress import Progress
from robot_layouts.data.playing.command_options import (
    GOES_ON,
    ControlMode,
    RecordingOption,
    WorkerOptions,
    stoppable,
    tell,
)
from robot_layouts.data.playing.executor import Executor, InProcessExecutor, checked_seeds, play_all
from robot_layouts.data.playing.mode_conversion import converted_steps, why_lost
from robot_layouts.data.playing.replay import RecordedJob
from robot_layouts.data.playing.scheduler import Event, WorkersDied
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording, Trajectory
from robot_layouts.data.recording.episode_files import PartEncoder
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tasks import TaskEnv
from tasks.episode import play


@dataclass
class Conversion:
    """The result of converting a recording.

    Attributes:
        path: Where it is.
        kept: Seeds of the episodes that succeed in the other mode, too.
        lost: Seeds of those that do not.
        left_out: Numbers of the episodes that have no seed, or did not succeed in their own mode.
        reasons: Why those are not kept, in words, by seed.
    """

    path: Path
    kept: list[int] = field(default_factory=list[int])
    lost: list[int] = field(default_factory=list[int])
    left_out: list[int] = field(default_factory=list[int])
    reasons: dict[int, str] = field(default_factory=dict[int, str])

    @property
    def complete(self) -> bool:
        """Whether every episode that could be converted was kept."""
        return bool(self.kept) and not self.lost

    def __str__(self) -> str:
        """Say it in words."""
        tried = len(self.kept) + len(self.lost)
        lines = [f"{len(self.kept)} of {tried} successful episodes succeed in the other mode, too"]
        if self.lost:
            lines.append(f"not kept: the seeds {', '.join(map(str, self.lost))}")
        if self.left_out:
            numbers = ", ".join(map(str, self.left_out))
            lines.append(f"left out, as they have no seed or no success: the episodes {numbers}")
        reasons = [f"seed {seed}: {reason}" for seed, reason in self.reasons.items()]
        return "\n".join(["; ".join(lines) + f": {self.path}", *reasons])


@dataclass(frozen=True)
class ConvertJob(RecordedJob):
    """Episodes that are converted.

    Attributes:
        mode: The other mode, or one by arm.
        encoder: What encodes those that succeed in it.
    """

    mode: str | Mapping[str, str]
    encoder: PartEncoder

    def tools(self, task: TaskEnv) -> TaskEnv:
        """Return the task in the other mode."""
        return _in_mode(task, self.mode)

    def play(self, task: TaskEnv, episode: Trajectory, tools: TaskEnv) -> bytes | str:
        """Convert an episode; what is to be stored of it, or why it does not succeed."""
        seed, converted = episode.seed, tools
        assert seed is not None
        actions, steps = converted_steps(task, seed, episode.actions, converted)
        played = play(converted, seed, actions)
        if not played.solved:
            return why_lost(task, seed, episode.actions, converted)
        actor = None if episode.actor is None else episode.actor[steps]
        return self.encoder.encode(replace(played, source=episode.source, actor=actor))


def _in_mode(task: TaskEnv, mode: str | Mapping[str, str]) -> TaskEnv:
    return task.task_class(replace(task.scenario, control_mode=mode))


def convert(
    file: Recording,
    mode: str | Mapping[str, str],
    folder: Path,
    count: int | None = None,
    cell: Mapping[str, Any] | None = None,
    *,
    executor: Executor | None = None,
    on_event: Callable[[Conversion, Event | None], None] = lambda found, event: None,
) -> Conversion:
    """Record the successful episodes of a recording in another control mode.

    Who acted is kept; what a corrector would have done is not, as it was not played. What is
    recorded does not depend on who plays.

    Args:
        file: The recording.
        mode: The other mode, or one by arm.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written; episodes that are
            there already are kept.
        count: How many of the first episodes; None: all.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        executor: Who plays; None: this process.
        on_event: Called once at the start without an event, and after every event.

    Raises:
        TrajectoryError: If the recording cannot be played here.
        TaskError: If there is no such mode, or two episodes have the same seed.
        RecordingError: If the folder cannot be written or holds a recording of something else.
        WorkerError: If workers cannot be started, or die again and again.
        KeyboardInterrupt: If interrupted; finished episodes are kept.
    """
    with (
        closing(task_for(file, **(cell or {}))) as source,
        closing(_in_mode(source, mode)) as task,
    ):
        recorder = Recorder(
            folder / FILE,
            task,
            resume=True,
            source=file.source_type or "scripted",
            source_desc=f"converted from {file.control_mode}",
        )
    with recorder:
        found, places = Conversion(recorder.path), dict[int, int]()
        for number in range(len(file) if count is None else count):
            episode = file[number]
            if episode.seed is None or episode.solved is False:
                found.left_out.append(episode.episode_id)
            elif episode.seed in places:
                checked_seeds([*places, episode.seed])  # refuses it
            else:
                places[episode.seed] = number
        missing = [seed for seed in places if seed not in recorder.seeds]
        found.kept += [seed for seed in places if seed in recorder.seeds]
        recorder.expect(missing)
        on_event(found, None)
        job = ConvertJob.of(file, places, cell, mode=mode, encoder=recorder.encoder)
        with closing(play_all(executor or InProcessExecutor(), job, missing)) as events:
            for event in events:
                _note(found, event, recorder)
                on_event(found, event)
    order = {seed: rank for rank, seed in enumerate(places)}
    found.kept.sort(key=order.__getitem__)
    found.lost.sort(key=order.__getitem__)
    return found


def _note(found: Conversion, event: Event, recorder: Recorder) -> None:
    seed, result = event.seed, event.result
    if event.error is not None and not isinstance(event.error, WorkersDied):
        raise event.error
    if seed is None or (result is None and event.error is None):
        return
    if isinstance(result, bytes):
        recorder.store(seed, result)
        found.kept.append(seed)
    else:
        recorder.give_up(seed)
        found.lost.append(seed)
        found.reasons[seed] = str(event.error) if result is None else result


def convert_command(
    recording: RecordingOption,
    *,
    to: ControlMode,
    out: Folder,
    episodes: int | None = None,
    workers: WorkerOptions,
) -> int:
    """Record the episodes of a recording again in another control mode.

    Each episode is played in its own mode and in the other, and kept if it succeeds there too.
    Those that did not succeed when they were recorded are left out. The same command goes on where
    it was stopped. Exit code: 0 if all others were kept, 1 if not, 2 for bad usage, 130 if
    interrupted.

    Args:
        recording: The recording.
        to: The other mode.
        out: Folder of trajectory.h5 and .json.
        episodes: Convert the first N episodes (all).
        workers: Who plays.

    Raises:
        RobotLayoutsError: If the recording cannot be played or the other not be written.
    """
    with recording.open() as file:
        count = recording.count(file, episodes)
        if not count:
            raise RecordingError(f"{file.path} has no episodes to convert")
        executor, line = workers.executor(), Progress(count, "episodes")

        def show(found: Conversion, event: Event | None) -> None:
            if event is not None:
                tell(line, event)
            done = len(found.kept) + len(found.lost) + len(found.left_out)
            line.update(done, "converting")

        with stoppable(lambda: GOES_ON), line:
            summary = convert(
                file,
                to,
                out,
                count,
                recording.cell.making(),
                executor=executor,
                on_event=show,
            )
    print(printable(str(summary)))
    return 0 if summary.complete else 1
