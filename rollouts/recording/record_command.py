"""``robot-layouts record``: episodes of an expert or a policy become a data set."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robots import RecordingError
from robots.common.pages import plural
from rollouts.playing import command_options as workers
from rollouts.playing.command_options import INTERRUPTED, one_or_more, stop_signals, zero_or_more
from rollouts.playing.seeds import seed_lines
from tasks.cell_options import add_cell_options, chosen_cell

if TYPE_CHECKING:
    from rollouts.playing.executor import Event
    from rollouts.progress import LiveLine
    from rollouts.recording.record import Summary

EPILOG = (
    "The same command goes on where it was stopped or killed. Exit code: 0 if every episode was"
    " recorded, 1 if not, 2 for bad usage, 130 if interrupted. A policy maps an observation to an"
    " action; see rollouts.record. Episodes of other seeds may come from others: each says who"
    " acted."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("--task", required=True, help="task id; MODULE:ID for one of your own")
    add("--episodes", type=one_or_more, required=True, metavar="N", help="number of episodes")
    workers.add_arguments(parser)
    add("--seed", type=zero_or_more, default=0, metavar="S", help="seeds S … S + N - 1 (0)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder of trajectory.h5 and .json")
    add(
        "--policy",
        default="expert",
        metavar="MODULE:NAME",
        help="a policy that can be imported, asked at every step; by default the task's expert",
    )
    add(
        "--takeover",
        metavar="MODULE:NAME",
        help="policy that acts instead at every step for which it returns an action, not None",
    )
    add(
        "--corrector",
        metavar="MODULE:NAME",
        help="policy whose action is recorded at every step beside the one that is played",
    )
    workers.add_observed(parser)
    add(
        "--num-envs",
        type=one_or_more,
        default=1,
        metavar="N",
        help="episodes that each process plays at once (%(default)s)",
    )
    add_cell_options(parser)
    workers.add_control_mode(parser)
    workers.add_file_size(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If it makes no sense, or cannot go on; finished episodes are kept.
    """
    from rollouts.playing.executor import WorkerError
    from rollouts.progress import LiveLine
    from rollouts.recording.record import FILE, record

    seeds = range(options.seed, options.seed + options.episodes)
    executor, line = workers.chosen_executor(options), LiveLine(len(seeds), "episodes")
    status = _Status(line)
    try:
        with stop_signals(), line:
            summary = record(
                options.task,
                seeds,
                options.out,
                executor,
                control_mode=options.control_mode,
                policy=options.policy,
                takeover=options.takeover,
                corrector=options.corrector,
                obs_mode=options.obs_mode,
                camera_size=options.camera_size,
                num_envs=options.num_envs,
                file_size=options.file_size,
                **chosen_cell(options),
                on_event=status.show,
            )
    except KeyboardInterrupt:
        print(f"stopped; {status.kept}; the same command goes on from there", file=sys.stderr)
        return INTERRUPTED
    except (RecordingError, WorkerError):
        print(f"stopped; {status.kept}", file=sys.stderr)
        raise
    _report(summary, options.out / FILE)
    return 1 if summary.failed else 0


class _Status:
    """How far the recording is, and what happens on the way."""

    def __init__(self, line: LiveLine) -> None:
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


def _report(summary: Summary, path: Path) -> None:
    played = summary.played.values()
    print(f"{path}: {plural(summary.recorded, 'episode')}")
    if played:
        solved = sum(score.success for score in played)
        steps = sum(score.steps for score in played) / len(played)
        new = plural(len(played), "new episode")
        print(f"{new}, {solved} with success, {steps:.1f} steps on average")
        if len(summary.workers) > 1:
            print(f"played by {len(summary.workers)} workers")
    failed = {seed: score.reason for seed, score in summary.played.items() if not score.success}
    for line in seed_lines("no success", dict(sorted(failed.items()))):
        print(line)
    for death in summary.deaths:
        print(f"replaced: {death}")
    reasons = {seed: str(error) for seed, error in sorted(summary.failed.items())}
    for line in seed_lines("not recorded", reasons):
        print(line)
