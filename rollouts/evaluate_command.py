"""``robot-layouts evaluate``: how well a policy or an expert does."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rollouts.playing import command_options as workers
from rollouts.playing.command_options import INTERRUPTED, one_or_more, stop_signals, zero_or_more
from tasks.cell_options import add_cell_options, chosen_cell

if TYPE_CHECKING:
    from rollouts.playing.executor import Event
    from rollouts.progress import LiveLine

EPILOG = (
    "A policy maps an observation to an action; see rollouts.evaluate. Exit code: 0 if all was"
    " played, 1 if not, 2 for bad usage, 130 if interrupted."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("--task", required=True, help="task id; MODULE:ID for one of your own")
    add(
        "--policy",
        default="expert",
        metavar="MODULE:NAME",
        help="a policy that can be imported; by default the task's expert",
    )
    add(
        "--episodes",
        type=one_or_more,
        default=100,
        metavar="N",
        help="number of episodes (%(default)s)",
    )
    workers.add_arguments(parser)
    add("--seed", type=zero_or_more, default=0, metavar="S", help="seeds S … S + N - 1 (0)")
    add("--receipt", type=Path, metavar="JSON", help="write a receipt, which `verify` plays again")
    workers.add_observed(parser)
    workers.add_control_mode(parser)
    add_cell_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If it makes no sense, or the policy fails.
    """
    from rollouts.evaluation import evaluate
    from rollouts.progress import LiveLine

    executor, line = workers.chosen_executor(options), LiveLine(options.episodes, "episodes")
    try:
        with stop_signals(), line:
            found = evaluate(
                options.policy,
                options.task,
                range(options.seed, options.seed + options.episodes),
                executor=executor,
                receipt=options.receipt,
                on_event=_Status(line).show,
                obs_mode=options.obs_mode,
                camera_size=options.camera_size,
                control_mode=options.control_mode,
                **chosen_cell(options),
            )
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return INTERRUPTED
    print(found)
    if found.receipt is not None:
        print(f"{options.receipt}: receipt {found.receipt.hash}")
    return 0


class _Status:
    """How far the evaluation is."""

    def __init__(self, line: LiveLine) -> None:
        self._line = line
        self._solved = self._played = 0

    def show(self, event: Event) -> None:
        """Tell what has come of the episodes so far."""
        if event.news is not None:
            self._line.say(event.news)
        if event.result is not None:
            self._played += 1
            self._solved += event.result.success
        self._line.update(self._played, f"evaluating (succeeded so far: {self._solved})")
