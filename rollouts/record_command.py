"""``python -m rollouts record``: an expert's episodes become a data set."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from robots import CONTROL_MODES, RecordingError

if TYPE_CHECKING:
    from rollouts.executor import Event
    from rollouts.progress import LiveLine
    from rollouts.record import Summary

DESCRIPTION = "let an expert play episodes in worker processes, and record them"
EPILOG = (
    "The same command goes on where it was stopped or killed. Exit code: 0 if every episode was"
    " recorded, 1 if not, 2 for bad usage, 130 if interrupted."
)
INTERRUPTED = 130  # as shells have it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("--task", required=True, help="task id")
    add("--episodes", type=_one_or_more, required=True, metavar="N", help="how many episodes")
    add("--workers", type=_one_or_more, default=1, metavar="W", help="how many processes (1)")
    add("--seed", type=_zero_or_more, default=0, metavar="S", help="seeds S … S + N - 1 (0)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder of trajectory.h5 and .json")
    add("--control-mode", choices=CONTROL_MODES, default=CONTROL_MODES[0], help="(%(default)s)")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If it makes no sense, or cannot go on; finished episodes are kept.
    """
    from rollouts.executor import ProcessExecutor, WorkerError
    from rollouts.progress import LiveLine
    from rollouts.record import FILE, record

    seeds = range(options.seed, options.seed + options.episodes)
    line = LiveLine(len(seeds), "episodes")
    status = _Status(line)
    try:
        with _stop_signals(), line:
            summary = record(
                options.task,
                seeds,
                options.out,
                ProcessExecutor(options.workers),
                control_mode=options.control_mode,
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
        if event is None and summary.already:
            total = self._line.total
            self._line.say(f"{summary.already} of {total} episodes were recorded before")
        if event is not None and event.died is not None:
            self._line.say(f"{summary.deaths[-1]}; another takes its place")
        if event is not None and event.error is not None:
            self._line.say(f"seed {event.seed} is not recorded: {event.error}")
        solved = sum(played.success for played in summary.played.values())
        done = summary.already + len(summary.played)
        self._line.update(done, f"{solved} of {len(summary.played)} succeeded")


def _report(summary: Summary, path: Path) -> None:
    solved = sum(played.success for played in summary.played.values())
    print(f"{path}: {summary.recorded} episodes")
    if summary.played:
        count = len(summary.played)
        steps = sum(played.steps for played in summary.played.values()) / count
        print(f"recorded now {count}, {solved} with success, {steps:.1f} steps on average")
    for death in summary.deaths:
        print(f"made good: {death}")
    if summary.failed:
        print(f"not recorded: seeds {', '.join(map(str, sorted(summary.failed)))}")


@contextmanager
def _stop_signals() -> Generator[None]:
    """Let a request to end, as schedulers send it, stop like Ctrl-C."""

    def stop(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _one_or_more(text: str) -> int:
    return _at_least(1, text)


def _zero_or_more(text: str) -> int:
    return _at_least(0, text)


def _at_least(least: int, text: str) -> int:
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"{number} is too few; it must be {least} or more")
    return number
