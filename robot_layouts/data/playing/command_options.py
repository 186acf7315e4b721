"""What commands that play many episodes have in common: who plays, and how they are stopped."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from robot_layouts.core.cli import File, Word, at_least
from robot_layouts.data.playing.scheduler import EPISODE_SECONDS, check_timeout
from robots import CONTROL_MODES, TaskError
from robots.control_modes import read_mode
from tasks.cell_options import RecordedCell
from tasks.engine.cameras import load_cameras
from tasks.engine.scenario import VISUALS

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.executor import Executor
    from robot_layouts.data.playing.scheduler import Event
    from robot_layouts.data.reading.recording import Recording

INTERRUPTED = 130  # exit code, as shells have it
GOES_ON = "stopped; the same command goes on from there"


def _timeout(text: str) -> float | None:
    try:
        seconds = None if text == "none" else float(text)
        check_timeout(seconds)
    except (ValueError, TaskError):
        raise ValueError(f"{text} is no limit; it must be seconds, more than 0, or none") from None
    return seconds


def megabytes(text: str) -> float:
    """Return how large a file may be (MB)."""
    try:
        size = float(text)
    except ValueError:
        size = 0.0
    if not 0 < size < math.inf:
        raise ValueError(f"{text} is no size; it must be MB, more than 0")
    return size


def _picture_size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise ValueError(f"{text!r} is no size; it is WxH, as 128x96") from None


PictureSize = Annotated[tuple[int, int], Word("WxH", _picture_size)]
Policy = Annotated[str, Word("MODULE:NAME|ws://HOST:PORT|hub:OWNER/NAME")]
RecordingPath = Annotated[Path, Word("FILE|hub:OWNER/NAME")]
ControlMode = Annotated[
    str | dict[str, str],
    Word(
        "MODE",
        read_mode,
        about=f"one of {', '.join(CONTROL_MODES)}; or by arm:"
        f" left={CONTROL_MODES[0]},right={CONTROL_MODES[1]}",
    ),
]


@dataclass(frozen=True, kw_only=True)
class Observing:
    """What is observed, by which cameras.

    Attributes:
        obs_mode: What to observe: state, state_dict, rgb and others (state).
        camera_size: Width and height in pixels of the pictures observed (each camera's own).
        cameras: Cameras in place of the task's, and settings of any (.yaml).
        visuals: Draw robots as their files have them, or with fewer triangles (full).
    """

    obs_mode: Annotated[str, Word("MODE")] | None = None
    camera_size: PictureSize | None = None
    cameras: File | None = None
    visuals: Annotated[str, Word(choices=VISUALS)] | None = None

    def observing(self) -> dict[str, Any]:
        """Return those that are given as arguments of `tasks.make`.

        Raises:
            TaskError: If the cameras cannot be read, or one is invalid.
        """
        names = ("obs_mode", "camera_size", "visuals")
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return given | ({} if self.cameras is None else load_cameras(self.cameras))


@dataclass(frozen=True, kw_only=True)
class Acting(Observing):
    """Who acts, on what it observes, and what its actions ask for.

    Attributes:
        policy: A policy that can be imported, where one is served (ws://HOST:PORT#KEYS, KEYS
            being droid, aloha or a YAML file), or one on the Hub; by default the task's expert.
        control_mode: What actions ask for (as the layout says, else pd_joint_delta_pos).
    """

    policy: Policy = "expert"
    control_mode: ControlMode | None = None

    def playing(self) -> dict[str, Any]:
        """Return these options as arguments of what plays.

        Raises:
            TaskError: See `Observing.observing`.
        """
        observed = Observing.__dataclass_fields__
        own = {name: value for name, value in vars(self).items() if name not in observed}
        return {**own, **self.observing()}


@dataclass(frozen=True, kw_only=True)
class WorkerOptions:
    """Which processes play the episodes of a recording.

    Attributes:
        workers: How many processes; 0: this one.
        episode_timeout: End a worker whose episode takes longer, and play that again; none: never.
    """

    workers: Annotated[int, Word("W", at_least(0))] | None = 0
    episode_timeout: Annotated[float | None, Word("SECONDS", _timeout)] = EPISODE_SECONDS

    def executor(self) -> Executor:
        """Return who plays.

        Raises:
            RobotLayoutsError: If the options contradict each other.
        """
        from robot_layouts.data.playing.executor import choose_executor

        return choose_executor(self.workers, episode_timeout=self.episode_timeout)


@dataclass(frozen=True, kw_only=True)
class Players(WorkerOptions):
    """Who plays the episodes.

    Attributes:
        workers: How many processes (one for each core or, with --ray, each CPU of the cluster, but
            no more than episodes); 0: this one.
        ray: Play on a Ray cluster that this machine has joined: "HOST:PORT" or "auto".
    """

    workers: Annotated[int, Word("W", at_least(0))] | None = None
    ray: Annotated[str, Word("ADDRESS")] | None = None

    def executor(self) -> Executor:
        """Return who plays.

        Raises:
            MissingPackageError: If Ray is asked for and not installed.
            RobotLayoutsError: If the options contradict each other.
        """
        if self.ray is not None:
            from robot_layouts.data.playing.ray_executor import RayExecutor

            return RayExecutor(self.ray, self.workers, episode_timeout=self.episode_timeout)
        return super().executor()


@dataclass(frozen=True, kw_only=True)
class RecordingOption:
    """Which recording a command is about.

    Attributes:
        file: An h5 file, the folder of a recording, with all its files, or hub:OWNER/NAME@REVISION.
        task: Its task, MODULE:ID for one of your own; without FILE, find its official one in
            $MS_ASSET_DIR/demos.
        cell: Which robots stood where, where the recording cannot say it.
    """

    file: RecordingPath | None = field(default=None, kw_only=False)
    task: str | None = None
    cell: RecordedCell

    @property
    def path(self) -> Path:
        """Where it is; see `robot_layouts.data.playing.replay.recording_path`."""
        from robot_layouts.data.playing.replay import recording_path

        return recording_path(self.file, self.task)

    def open(self) -> AbstractContextManager[Recording]:
        """Open it; see `robot_layouts.data.playing.replay.open_recording`."""
        from robot_layouts.data.playing.replay import open_recording

        return open_recording(self.file, self.task)

    @staticmethod
    def count(file: Recording, episodes: int | None) -> int:
        """Return how many episodes of a file are asked for and there; None asks for all."""
        return len(file) if episodes is None else max(0, min(episodes, len(file)))


def tell(line: Progress, event: Event, failed: str = "") -> None:
    """Print what happened to workers and, if there are words for it, why an episode has failed."""
    if event.news is not None:
        line.say(event.news)
    if event.error is not None and failed:
        line.say(f"seed {event.seed} {failed}: {event.error}")


@contextmanager
def stoppable(message: Callable[[], str] = lambda: "stopped") -> Generator[None]:
    """Let Ctrl-C, or a request to end, end the process with a message and 130."""
    try:
        with stop_signals():
            yield
    except KeyboardInterrupt:
        print(message(), file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None


@contextmanager
def stop_signals() -> Generator[None]:
    """Let a request to end, as schedulers send it, stop like Ctrl-C."""

    def stop(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
