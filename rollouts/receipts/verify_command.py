"""``robot-layouts verify``: what a receipt is of is played again, to the last bit."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robots.common.commands import printable
from rollouts.playing import command_options as workers
from rollouts.playing.command_options import INTERRUPTED, one_or_more, stop_signals

if TYPE_CHECKING:
    from rollouts.playing.executor import Event
    from rollouts.progress import LiveLine
    from rollouts.receipts.receipt import Receipt

EPILOG = (
    "Tells the first seed and step whose states differ, and which robot files, sources, versions"
    " and parts of the processor are not those of the receipt. Exit code: 0 if every bit and file"
    " is the same, whatever the versions; 1 if not; 2 for bad usage, 130 if interrupted."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("receipt", type=Path, metavar="RECEIPT", help="what `evaluate --receipt` wrote")
    add("--policy", metavar="MODULE:NAME", help="the policy, unless it is an expert")
    add("--task", metavar="MODULE:ID", help="the task, if no installed package lists it")
    add(
        "--robots",
        nargs="+",
        metavar="PLACE=ROBOT",
        help="which robots these were, where the receipt cannot say it",
    )
    add(
        "--num-envs",
        type=one_or_more,
        default=1,
        metavar="N",
        help="episodes that play at once (1)",
    )
    workers.add_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If it cannot be played again.
    """
    from robots import RobotDescriptor
    from rollouts.progress import LiveLine
    from rollouts.receipts.receipt import Receipt
    from rollouts.receipts.verification import verify
    from tasks.cell_options import chosen_robots

    receipt = Receipt.read(options.receipt)
    robots = chosen_robots(options.robots) if options.robots else {}
    if isinstance(robots, RobotDescriptor):
        robots = dict.fromkeys(receipt.making["layout"], robots)
    executor, line = workers.chosen_executor(options), LiveLine(len(receipt.episodes), "episodes")
    try:
        with stop_signals(), line:
            found = verify(
                receipt,
                executor,
                _Status(line, receipt).show,
                policy=options.policy,
                task=options.task,
                robots=robots,
                num_envs=options.num_envs,
            )
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return INTERRUPTED
    print(printable(repr(found)))
    print(_VERDICT[found.equal])
    return 0 if found.equal else 1


_VERDICT = {
    True: "equal: this is what the receipt says",
    False: "not equal: this is not what the receipt says",
}


class _Status:
    """How far it is."""

    def __init__(self, line: LiveLine, receipt: Receipt) -> None:
        self._line = line
        self._states = {episode.seed: episode.states for episode in receipt.episodes}
        self._played = self._equal = 0

    def show(self, event: Event) -> None:
        """Tell how many of the episodes so far are the same."""
        if event.news is not None:
            self._line.say(event.news)
        if event.seed is not None and event.result is not None:
            self._played += 1
            self._equal += event.result.trace.states == self._states[event.seed]
        self._line.update(self._played, f"verifying, {self._equal} of {self._played} equal")
