"""Records the episodes of a recording in another control mode."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from robot_layouts.core.cli import Folder
from robot_layouts.core.commands import printable
from robot_layouts.core.progress import Progress
from robot_layouts.data.playing.command_options import ControlMode, RecordingOption
from robot_layouts.data.playing.mode_conversion import converted_steps, why_lost
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tasks.episode import play


@dataclass
class Conversion:
    """The result of converting a recording.

    Attributes:
        path: Where it is.
        kept: Seeds of the episodes that succeed in the other mode, too.
        lost: Seeds of those that do not.
        left_out: Numbers of the episodes that have no seed, or did not succeed in their own mode.
        reasons: Why those that do not succeed do not, in words, by seed.
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


def convert(
    file: Recording,
    mode: str | Mapping[str, str],
    folder: Path,
    count: int | None = None,
    cell: Mapping[str, Any] | None = None,
    on_episode: Callable[[], None] = lambda: None,
) -> Conversion:
    """Record the successful episodes of a recording in another control mode.

    Who acted is kept; what a corrector would have done is not, as it was not played.

    Args:
        file: The recording.
        mode: The other mode, or one by arm.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written; episodes that are
            there already are kept.
        count: How many of the first episodes; None: all.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        on_episode: Called after each.

    Raises:
        TrajectoryError: If the recording cannot be played here.
        TaskError: If there is no such mode.
        RecordingError: If the folder cannot be written or holds a recording of something else.
    """
    with closing(task_for(file, **(cell or {}))) as source:
        task = source.task_class(replace(source.scenario, control_mode=mode))
        text = f"converted from {file.control_mode}"
        with (
            closing(task),
            Recorder(
                folder / FILE,
                task,
                resume=True,
                source=file.source_type or "scripted",
                source_desc=text,
            ) as recorder,
        ):
            found = Conversion(recorder.path)
            there = recorder.seeds
            for number in range(len(file) if count is None else count):
                episode = file[number]
                if episode.seed is None or episode.solved is False:
                    found.left_out.append(episode.episode_id)
                elif episode.seed in there:
                    found.kept.append(episode.seed)
                else:
                    actions, steps = converted_steps(source, episode.seed, episode.actions, task)
                    played = play(task, episode.seed, actions)
                    if played.solved:
                        actor = None if episode.actor is None else episode.actor[steps]
                        recorder.add(replace(played, source=episode.source, actor=actor))
                        found.kept.append(episode.seed)
                    else:
                        found.lost.append(episode.seed)
                        found.reasons[episode.seed] = why_lost(
                            source, episode.seed, episode.actions, task
                        )
                on_episode()
    return found


def convert_command(
    recording: RecordingOption, *, to: ControlMode, out: Folder, episodes: int | None = None
) -> int:
    """Record the episodes of a recording again in another control mode.

    Each episode is played in its own mode and in the other, and kept if it succeeds there too.
    Those that did not succeed when they were recorded are left out. Exit code: 0 if all others were
    kept, 1 if not, 2 for bad usage.

    Args:
        recording: The recording.
        to: The other mode.
        out: Folder of trajectory.h5 and .json.
        episodes: Convert the first N episodes (all).

    Raises:
        RobotLayoutsError: If the recording cannot be played or the other not be written.
    """
    torch.set_num_threads(1)
    with recording.open() as file:
        count = recording.count(file, episodes)
        if not count:
            raise RecordingError(f"{file.path} has no episodes to convert")
        with Progress(count, "episodes") as line:
            summary = convert(
                file,
                to,
                out,
                count,
                recording.cell.making(),
                lambda: line.advance(1, "converting"),
            )
    print(printable(str(summary)))
    return 0 if summary.complete else 1
