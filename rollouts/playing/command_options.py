"""What commands that play many episodes have in common: who plays, and how they are stopped."""

from __future__ import annotations

import argparse
import math
import signal
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from robots import CONTROL_MODES, DescriptorError, TaskError
from robots.control_modes import read_mode
from rollouts.playing.scheduler import EPISODE_SECONDS, check_timeout
from rollouts.reading.manifest import FILE_SIZE

if TYPE_CHECKING:
    from rollouts.playing.executor import Executor

INTERRUPTED = 130  # exit code, as shells have it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say who plays."""
    add = parser.add_argument
    add(
        "--workers",
        type=zero_or_more,
        metavar="W",
        help="how many processes (one for each core or, with --ray, each CPU of the cluster, but no"
        " more than episodes); 0: this one",
    )
    add(
        "--episode-timeout",
        type=_timeout,
        default=EPISODE_SECONDS,
        metavar="SECONDS",
        help="end a worker whose episode takes longer, and play that again; none: never (600)",
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
        RobotLayoutsError: If the options contradict each other.
    """
    if options.ray is not None:
        from rollouts.playing.ray_executor import RayExecutor

        timeout = options.episode_timeout
        return RayExecutor(options.ray, options.workers, episode_timeout=timeout)
    from rollouts.playing.executor import choose_executor

    return choose_executor(options.workers, episode_timeout=options.episode_timeout)


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


def _timeout(text: str) -> float | None:
    try:
        seconds = None if text == "none" else float(text)
        check_timeout(seconds)
    except (ValueError, TaskError):
        words = f"{text} is no limit; it must be seconds, more than 0, or none"
        raise argparse.ArgumentTypeError(words) from None
    return seconds


def add_file_size(parser: argparse.ArgumentParser) -> None:
    """Add the argument that says when a recording goes on in another file."""
    parser.add_argument(
        "--file-size",
        type=_size,
        default=FILE_SIZE,
        metavar="MB",
        help="begin another file, trajectory_0001.h5 and so on, when one is so large (%(default)g)",
    )


def _size(text: str) -> float:
    try:
        size = float(text)
    except ValueError:
        size = 0.0
    if not 0 < size < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no size; it must be MB, more than 0")
    return size


def _at_least(least: int, text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number") from None
    if number < least:
        raise argparse.ArgumentTypeError(f"{number} is too few; it must be {least} or more")
    return number


def add_observed(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what policies observe."""
    add = parser.add_argument
    words = "what policies observe: state, state_dict, rgb and others (%(default)s)"
    add("--obs-mode", default="state", metavar="MODE", help=words)
    words = "width and height in pixels of the pictures observed (each camera's own)"
    add("--camera-size", type=picture_size, metavar="WxH", help=words)


def picture_size(text: str) -> tuple[int, int]:
    """Read the width and height of pictures for argparse."""
    width, _, height = text.partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size; it is WxH, as 128x96") from None


def add_control_mode(
    parser: argparse.ArgumentParser, name: str = "--control-mode", **details: Any
) -> None:
    """Add the argument of a control mode, or of one for each arm.

    Args:
        parser: Takes it.
        name: Its name.
        details: Other arguments of ``add_argument``.
    """
    example = f"left={CONTROL_MODES[0]},right={CONTROL_MODES[1]}"
    without = "" if details.get("required") else f" (as the layout says, else {CONTROL_MODES[0]})"
    parser.add_argument(
        name,
        type=control_mode,
        metavar="MODE",
        help=f"one of {', '.join(CONTROL_MODES)}; or by arm: {example}{without}",
        **details,
    )


def control_mode(text: str) -> str | dict[str, str]:
    """Return the control mode that a text names, or those by arm.

    Raises:
        argparse.ArgumentTypeError: If it is neither.
    """
    try:
        return read_mode(text)
    except DescriptorError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
