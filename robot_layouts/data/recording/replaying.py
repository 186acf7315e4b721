"""Plays a recording again, in workers if asked for, and records what is observed in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from robot_layouts.core.cli import Folder, Word
from robot_layouts.core.commands import printable
from robot_layouts.core.progress import Progress
from robot_layouts.data.playing.command_options import (
    GOES_ON,
    Observing,
    RecordingOption,
    WorkerOptions,
    megabytes,
    stoppable,
    tell,
)
from robot_layouts.data.playing.executor import Executor, InProcessExecutor, play_all
from robot_layouts.data.playing.replay import (
    RecordedJob,
    Replayed,
    Start,
    places_by_seed,
    replay,
)
from robot_layouts.data.playing.scheduler import Event, WorkersDied
from robot_layouts.data.reading.json_files import FILE_SIZE
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording, Trajectory
from robot_layouts.data.recording.episode_files import PartEncoder
from robot_layouts.data.recording.recorder import Recorder
from robots import TaskError
from tasks import TaskEnv
from tasks.cell_options import Simulator
from tasks.episode import PlayedEpisode

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True)
class ReplayJob(RecordedJob):
    """Episodes that are played again.

    Attributes:
        start: How each begins; see `robot_layouts.data.playing.replay.replay`.
        encoder: What encodes episodes with what was observed in them; None if that is not kept.
    """

    start: Start
    encoder: PartEncoder | None

    def play(
        self, task: TaskEnv, episode: Trajectory, tools: None
    ) -> tuple[Replayed, bytes | None]:
        """Play an episode again; what is to be stored of it if it is as recorded."""
        encoder, kept = self.encoder, list[PlayedEpisode]()
        keep = None if encoder is None else kept.append
        found = replay(task, episode, self.start, keep=keep)
        return found, encoder.encode(kept[0]) if encoder and kept else None


@dataclass
class ReplaySummary:
    """The result of playing a recording again.

    Attributes:
        episodes: How many were asked for.
        already: How many of them were recorded again before.
        found: The result of each that was played, by its place in the recording.
        failed: Why others could not be played, likewise: their workers died.
    """

    episodes: int
    already: int = 0
    found: dict[int, Replayed] = field(default_factory=dict[int, Replayed])
    failed: dict[int, Exception] = field(default_factory=dict[int, Exception])

    @property
    def agrees(self) -> bool:
        """Whether there are episodes, and all end as recorded."""
        whole = bool(self.episodes) and not self.failed
        return whole and all(found.agrees for found in self.found.values())


def replay_recording(
    file: Recording,
    executor: Executor,
    *,
    count: int | None = None,
    start: Start = "seed",
    cell: Mapping[str, Any] | None = None,
    obs_mode: str | None = None,
    folder: Path | None = None,
    file_size: float = FILE_SIZE,
    simulator: str | None = None,
    on_event: Callable[[ReplaySummary, Event | None], None] = lambda summary, event: None,
    **observing: Any,
) -> ReplaySummary:
    """Play a recording again, and record what is observed in it.

    What is recorded does not depend on who plays; episodes that are in the folder already are not
    played, and those that are not as recorded are left out.

    Args:
        file: The recording.
        executor: Who plays.
        count: How many of the first episodes; None: all.
        start: See `robot_layouts.data.playing.replay.replay`.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        obs_mode: What to observe; None: nothing.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` with the observations are written.
        file_size: Size at which a further h5 file is begun (MB); see `Recorder`.
        simulator: What simulates them, if not what did so when they were recorded: a comparison of
            both, and no replay.
        on_event: Called once at the start without an event, and after every event.
        observing: With what that is drawn, as arguments of `tasks.make`, where it is otherwise than
            in the recording: ``camera_size``, ``cameras``, ``sensor_configs``, ``visuals``.

    Raises:
        TrajectoryError: If an episode cannot be played like that.
        TaskError: If a folder is given and no mode to observe in or the reverse, or seeds do not
            tell episodes apart, by which workers and recordings know them.
        RecordingError: If the folder cannot be written or holds a recording of something else.
        WorkerError: If workers cannot be started, or die again and again.
        KeyboardInterrupt: If interrupted; finished episodes are kept.
    """
    if (obs_mode is None) != (folder is None) or (folder is not None and start == "state"):
        raise TaskError("--obs-mode and --out go together, and not with --from state")
    if observing and folder is None:
        raise TaskError("nothing is drawn without --obs-mode and --out, so cameras do not matter")
    compares = simulator not in (None, file.simulator)
    if compares and folder is not None:
        raise TaskError(
            f"{file.path} was recorded in {file.simulator!r}; what {simulator!r} makes of it is no"
            " replay, and is not recorded as one: leave out --out and --obs-mode"
        )
    places, making = places_by_seed(file, count), dict(cell or {})
    if compares:
        making["simulator"] = simulator
    if places is None:
        if folder is not None or not isinstance(executor, InProcessExecutor):
            raise TaskError(
                f"{file.path} does not name another seed for each episode, by which workers and"
                " recordings know them; play it without --workers and --out"
            )
        places = {place: place for place in range(len(file.seeds[:count]))}
    summary, recorder = ReplaySummary(len(places)), None
    if folder is not None:
        making |= {"obs_mode": obs_mode, **observing}
        recorder = _recorder(file, folder, file_size, making)
    with nullcontext() if recorder is None else recorder:
        there = set[int]() if recorder is None else recorder.seeds
        missing = [seed for seed in places if seed not in there]
        summary.already = len(places) - len(missing)
        on_event(summary, None)
        if recorder is not None:
            recorder.expect(missing)
        encoder = None if recorder is None else recorder.encoder
        job = ReplayJob.of(file, places, making, start=start, encoder=encoder)
        with closing(play_all(executor, job, missing)) as events:
            for event in events:
                _note(summary, event, places, recorder)
                on_event(summary, event)
    return summary


def _note(
    summary: ReplaySummary, event: Event, places: Mapping[int, int], recorder: Recorder | None
) -> None:
    if event.seed is None or (event.result is None and event.error is None):
        return
    part = None
    if event.result is not None:
        summary.found[places[event.seed]], part = event.result
    elif isinstance(event.error, WorkersDied):
        summary.failed[places[event.seed]] = event.error
    elif event.error is not None:
        raise event.error
    if recorder is not None and part is None:
        recorder.give_up(event.seed)
    elif recorder is not None and part is not None:
        recorder.store(event.seed, part)


def _recorder(
    file: Recording, folder: Path, file_size: float, making: Mapping[str, Any]
) -> Recorder:
    """Return what records the episodes of a recording again, with what is observed in them."""
    with closing(task_for(file, **making)) as task:
        return Recorder(
            folder / FILE,
            task,
            resume=True,
            source=file.source_type or "scripted",
            source_desc=f"{task.obs_mode} of a recording",
            file_size=file_size,
            observed=True,
        )


def replay_command(
    recording: RecordingOption,
    *,
    episodes: int | None = None,
    from_: Start = "seed",
    observing: Observing,
    out: Folder | None = None,
    file_size: Annotated[float, Word("MB", megabytes)] = FILE_SIZE,
    workers: WorkerOptions,
    simulator: Simulator | None = None,
) -> int:
    """Play the actions of a recording again, and compare what happens.

    With --obs-mode and --out, episodes that end as recorded are recorded again, with what is
    observed in them; the same command goes on where it was stopped. What is written does not depend
    on who plays.

    Exit code: 0 if every episode ends as recorded, or if simulators are compared; 1 if not, or if a
    file cannot be played; 130 if interrupted.
    Episodes whose reset rebuilt the world must also have the recorded states to the last bit; those
    of reused worlds, and all that begin from a state, need not.

    Args:
        recording: The recording.
        episodes: Play the first N episodes (all).
        from_: Begin by a reset with the recorded seed, or, not exactly, from the recorded state.
        observing: What is observed.
        out: Folder of the trajectory.h5 and .json that hold what was observed.
        file_size: Begin another file, trajectory_0001.h5 and so on, when one is so large.
        workers: Who plays.
        simulator: Compare with what happens in another simulator; that is no replay.

    Raises:
        RobotLayoutsError: If the recording cannot be played, or the other not be written.
    """
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    with recording.open() as file:
        count = recording.count(file, episodes)
        executor, line = workers.executor(), Progress(count, "episodes")

        def show(summary: ReplaySummary, event: Event | None) -> None:
            if event is not None:
                tell(line, event, "is not played")
            elif summary.already:
                line.say(f"{summary.already} of {count} episodes were recorded before")
            done = summary.already + len(summary.found) + len(summary.failed)
            line.update(done, "replaying")

        with stoppable(lambda: "stopped" if out is None else GOES_ON), line:
            summary = replay_recording(
                file,
                executor,
                count=count,
                start=from_,
                cell=recording.cell.making(),
                folder=out,
                file_size=file_size,
                simulator=simulator,
                on_event=show,
                **observing.observing(),
            )
        engines = (file.simulator, simulator or file.simulator)
        title = f"{file.path}: {file.task_id}, {file.control_mode}"
    console.print(printable(title), soft_wrap=True)
    found = [episode for _, episode in sorted(summary.found.items())]
    console.print(_table(found))
    if engines[0] != engines[1]:
        console.print(_comparison(found, *engines), soft_wrap=True)
        return 0
    for sentence in _sentences(found, from_):
        console.print(sentence, soft_wrap=True)
    return 0 if summary.agrees else 1


def _table(found: Sequence[Replayed]) -> Table:
    from rich import box
    from rich.table import Table

    rows = Table(box=box.SIMPLE_HEAD)
    for name in ("episode", "seed", "steps"):
        rows.add_column(name, justify="right")
    for name in ("recorded", "here", "states"):
        rows.add_column(name)
    for episode in found:
        rows.add_row(
            str(episode.episode_id),
            "–" if episode.seed is None else str(episode.seed),
            str(episode.steps),
            _word(episode.recorded),
            _word(episode.success),
            _states(episode),
        )
    return rows


def _comparison(found: Sequence[Replayed], recorded: str, here: str) -> str:
    same = sum(episode.recorded == episode.success for episode in found)
    return (
        f"{same} of {len(found)} episodes, recorded in {recorded}, end alike in {here}. This"
        " compares two simulators; it is no replay."
    )


def _sentences(found: Sequence[Replayed], start: str) -> list[str]:
    same = sum(episode.recorded == episode.success for episode in found)
    equal = sum(episode.compared and episode.difference is None for episode in found)
    lines = [
        f"{same} of {len(found)} episodes end as recorded; in {equal} all states are equal to the"
        " last bit."
    ]
    if other := [str(episode.episode_id) for episode in found if not episode.varied_alike]:
        lines.append(f"Their worlds do not vary here as recorded: episodes {', '.join(other)}.")
    if start == "state":
        lines.append("From a state no replay is exact: PhysX's memory is not part of a state.")
    elif any(episode.difference and not episode.exact for episode in found):
        lines.append(
            "Worlds that were reused when an episode was recorded make its states depend on the"
            " episodes before; here every episode has a new world."
        )
    return lines


def _states(episode: Replayed) -> str:
    if not episode.compared:
        return "not recorded"
    return "equal" if episode.difference is None else f"differ {printable(str(episode.difference))}"


def _word(success: bool | None) -> str:
    return {True: "success", False: "failure", None: "–"}[success]
