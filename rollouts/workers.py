"""What commands that play many episodes have in common: who plays, and how they are stopped."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from rollouts.executor import Executor

INTERRUPTED = 130  # exit code, as shells have it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say who plays."""
    add = parser.add_argument
    add(
        "--workers",
        type=one_or_more,
        metavar="W",
        help="how many processes (1; with --ray, one for each CPU of the cluster)",
    )
    add(
        "--ray",
        metavar="ADDRESS",
        help='play on a Ray cluster that this machine has joined: "HOST:PORT" or "auto"',
    )


def chosen_executor(options: argparse.Namespace) -> Executor:
    """Return who plays.

    Raises:
        MissingPackageError: If Ray is asked for and not installed.
    """
    if options.ray is not None:
        from rollouts.ray_executor import RayExecutor

        return RayExecutor(options.ray, options.workers)
    from rollouts.executor import ProcessExecutor

    return ProcessExecutor(options.workers or 1)


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


def one_or_more(text: str) -> int:
    """Read a number for argparse."""
    return _at_least(1, text)


def zero_or_more(text: str) -> int:
    """Read a number for argparse."""
    return _at_least(0, text)


def _at_least(least: int, text: str) -> int:
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"{number} is too few; it must be {least} or more")
    return number
