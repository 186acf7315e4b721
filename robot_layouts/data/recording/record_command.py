"""``robot-layouts record``: episodes of an expert or a policy become a data set."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Count, Folder, Seed, Word
from robot_layouts.data.playing.command_options import (
    Acting,
    Players,
    Policy,
    megabytes,
    stoppable,
)
from robot_layouts.data.reading.manifest import FILE_SIZE
from robots import RecordingError
from tasks.cell_options import Cell

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.executor import Event
    from robot_layouts.data.recording.record import Summary


@dataclass(frozen=True, kw_only=True)
class RecordOptions(Acting):
    """Who acts, and what is written.

    Attributes:
        takeover: Policy that acts instead at every step for which it returns an action, not None.
        corrector: Policy whose action is recorded at every step beside the one that is played.
        num_envs: Episodes that each process plays at once.
        file_size: Begin another file, trajectory_0001.h5 and so on, when one is so large.
    """

    takeover: Policy | None = None
    corrector: Policy | None = None
    num_envs: Count = 1
    file_size: Annotated[float, Word("MB", megabytes)] = FILE_SIZE


def record(
    *,
    task: str,
    episodes: Count,
    out: Folder,
    players: Players,
    seed: Seed = 0,
    options: RecordOptions,
    cell: Cell,
) -> int:
    """Let an expert or a policy play episodes in worker processes, and record them.

    The same command goes on where it was stopped or killed. Exit code: 0 if every episode was
    recorded, 1 if not, 2 for bad usage, 130 if interrupted. A policy maps an observation to an
    action; see robot_layouts.record. Episodes of other seeds may come from others: each says who
    acted.

    Args:
        task: Task id; MODULE:ID for one of your own.
        episodes: Number of episodes.
        out: Folder of trajectory.h5 and .json.
        players: Who plays.
        seed: Seeds S … S + N - 1.
        options: Who acts, and what is written.
        cell: The task's robots, and what varies.

    Raises:
        RobotLayoutsError: If it makes no sense, or cannot go on; finished episodes are kept.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.executor import WorkerError
    from robot_layouts.data.recording import record as recording

    seeds = range(seed, seed + episodes)
    executor, line = players.executor(), Progress(len(seeds), "episodes")
    status = _Status(line)

    def goes_on() -> str:
        return f"stopped; {status.kept}; the same command goes on from there"

    try:
        with stoppable(goes_on), line:
            summary = recording.record(
                task,
                seeds,
                out,
                executor,
                on_event=status.show,
                **vars(options),
                **cell.making(),
            )
    except (RecordingError, WorkerError):
        print(f"stopped; {status.kept}", file=sys.stderr)
        raise
    print(summary)
    return 1 if summary.failed else 0


class _Status:
    """How far the recording is, and what happens on the way."""

    def __init__(self, line: Progress) -> None:
        self._line = line
        self._summary: Summary | None = None

    @property
    def kept(self) -> str:
        """How many episodes are on the disk, in words."""
        return f"{self._summary.recorded if self._summary else 0} episodes are recorded"

    def show(self, summary: Summary, event: Event | None) -> None:
        """Tell what has come of the episodes so far."""
        self._summary = summary
        if event is None:
            for what in summary.damaged:
                self._line.say(f"{what} is damaged and does not count as recorded")
        if event is None and summary.already:
            total = self._line.total
            self._line.say(f"{summary.already} of {total} episodes were recorded before")
        if event is not None and event.news is not None:
            self._line.say(event.news)
        if event is not None and event.error is not None:
            self._line.say(f"seed {event.seed} is not recorded: {event.error}")
        solved = sum(played.success for played in summary.played.values())
        done = summary.already + len(summary.played)
        who = f"; {len(summary.workers)} workers" if len(summary.workers) > 1 else ""
        self._line.update(done, f"recording (succeeded so far: {solved}{who})")
