"""``python -m rollouts record``: an expert's episodes become a data set."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from robots import CONTROL_MODES, RecordingError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from rollouts.executor import Event
    from rollouts.record import Summary

DESCRIPTION = "let an expert play episodes in worker processes, and record them"
EPILOG = (
    "The same command goes on where it was stopped or killed. Exit code: 0 if every episode was"
    " recorded, 1 if not, 2 for bad usage, 130 if interrupted."
)
INTERRUPTED = 130  # as shells have it

_PLAIN_INTERVAL = 10.0  # s between lines where stderr is no terminal


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
    from rollouts.record import FILE, record

    seeds = range(options.seed, options.seed + options.episodes)
    line = _Line(len(seeds))
    try:
        with _stop_signals(), line:
            summary = record(
                options.task,
                seeds,
                options.out,
                ProcessExecutor(options.workers),
                control_mode=options.control_mode,
                on_event=line.show,
            )
    except KeyboardInterrupt:
        print(f"stopped; {line.kept}; the same command goes on from there", file=sys.stderr)
        return INTERRUPTED
    except (RecordingError, WorkerError):
        print(f"stopped; {line.kept}", file=sys.stderr)
        raise
    _report(summary, options.out / FILE)
    return 1 if summary.failed else 0


class _Line:
    """How far the recording is: a bar on a terminal, else a line every ten seconds."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._progress: Progress | None = None
        self._bar: TaskID | None = None
        self._next = time.monotonic() + _PLAIN_INTERVAL
        self._summary: Summary | None = None

    @property
    def kept(self) -> str:
        """How many episodes are on the disk, in words."""
        if self._summary is None:
            return "nothing was begun"
        return f"{self._summary.recorded} episodes are recorded"

    def __enter__(self) -> _Line:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress

            self._progress = Progress(console=Console(stderr=True), transient=True)
            self._progress.start()
            self._bar = self._progress.add_task("starting", total=self._total)
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def show(self, summary: Summary, event: Event | None) -> None:
        """Tell what has come of the episodes so far."""
        done = summary.already + len(summary.played)
        self._summary = summary
        if event is None and summary.already:
            self._say(f"{summary.already} of {self._total} episodes were recorded before")
        if event is not None and event.died is not None:
            self._say(f"{summary.deaths[-1]}; another takes its place")
        if event is not None and event.error is not None:
            self._say(f"seed {event.seed} is not recorded: {event.error}")
        solved = sum(played.success for played in summary.played.values())
        text = f"{solved} of {len(summary.played)} succeeded"
        if self._progress is not None and self._bar is not None:
            self._progress.update(self._bar, completed=done, description=text)
        elif (now := time.monotonic()) >= self._next:
            self._next = now + _PLAIN_INTERVAL
            self._say(f"{done} of {self._total} episodes, {text}")

    def _say(self, text: str) -> None:
        if self._progress is not None:
            self._progress.console.print(text, highlight=False, markup=False, soft_wrap=True)
        else:
            print(text, file=sys.stderr, flush=True)


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
