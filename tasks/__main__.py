"""``python -m tasks``: lists tasks, describes one, or shows it on a page."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from rich.console import Console

from layouts.view_command import add_page_options, page_words, show
from robots.common.commands import exit_code, start
from tasks.description import (
    declared_facts,
    describe,
    list_table,
    parity_verdicts,
    recorded_sizes,
)
from tasks.registry import list_tasks, make
from tasks.view import task_cell

MIN_WIDTH = 120  # columns that a table may take; a narrower terminal wraps it
LEGEND = (
    "norm is normalized_dense; the first reward mode is the default. parity: the last recorded"
    " comparison with native ManiSkill, where there was one; obs is the size recorded there."
    " `describe TASK` counts the observation of any task, which takes its robots' files."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Words after ``python -m tasks``; by default those of this process.

    Returns:
        Exit status: 0 if all went well, 1 after an error, 2 if there is no such task.
    """
    options = _parser().parse_args(arguments)
    return exit_code(lambda: options.run(options))


def _list(options: argparse.Namespace) -> None:
    verdicts, sizes = parity_verdicts(), recorded_sizes()
    rows = [declared_facts(task_id, sizes.get(task_id)) for task_id in list_tasks()]
    console = _console()
    console.print(list_table(rows, verdicts))
    console.print(LEGEND)


def _describe(options: argparse.Namespace) -> None:
    env = make(options.task)
    console = _console()
    for part in describe(env):
        console.print(part, soft_wrap=isinstance(part, str))
    env.close()


def _view(options: argparse.Namespace) -> int:
    """Show a task as it is reset, or hand a recording over to the room that reads recordings."""
    if options.demo is not None:
        words = ["view", options.demo, "--task", options.task, "--episode", str(options.episode)]
        os.execv(sys.executable, [sys.executable, "-m", "rollouts", *words, *page_words(options)])
    env = make(options.task, obs_mode="none")
    env.reset(options.seed)
    status = show(lambda: task_cell(env, f"{env.task_id}, seed {options.seed}"), options)
    env.close()
    return status


def _console() -> Console:
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, MIN_WIDTH)
    return console


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tasks", description="See which tasks there are, and what each is."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    every = commands.add_parser("list", help="print every task as a row of a table")
    every.set_defaults(run=_list)
    one = commands.add_parser("describe", help="print everything about a task")
    one.add_argument("task", metavar="TASK", help="task id or another of its names")
    one.set_defaults(run=_describe)
    view = commands.add_parser(
        "view",
        help="look at a task, or at a demonstration of it, in a browser",
        epilog="--demo hands over to `python -m rollouts view`.",
    )
    view.add_argument("task", metavar="TASK", help="task id or another of its names")
    view.add_argument("--seed", type=int, default=0, metavar="N", help="of the reset (0)")
    view.add_argument("--demo", metavar="FILE", help="an h5 file of recorded episodes")
    view.add_argument("--episode", type=int, default=0, metavar="N", help="the Nth of them (0)")
    add_page_options(view)
    view.set_defaults(run=_view)
    return parser


if __name__ == "__main__":
    start(main)
