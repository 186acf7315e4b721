"""``robot-layouts suite``: tasks × seeds × layouts in one file, played, reported, verified."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robots.common.commands import printable
from robots.common.console import add_command
from rollouts.playing import command_options as workers
from rollouts.playing.command_options import INTERRUPTED, stop_signals

if TYPE_CHECKING:
    from rollouts.playing.executor import Event
    from rollouts.progress import LiveLine
    from rollouts.suite.suite import Case

_FOLDER = "the folder of a run"

RUN_EPILOG = (
    "The same command goes on where it was stopped: what has a receipt is not played again. Exit"
    " code: 0 if all was played, 1 if not, 2 for bad usage, 130 if interrupted."
)
VERIFY_EPILOG = (
    "Exit code: 0 if every episode is equal to the last bit, 1 if not, 2 for bad usage, 130 if"
    " interrupted."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (about, epilog, add_own, run_own) in _COMMANDS.items():
        own = add_command(commands, name, about, epilog)
        add_own(own)
        own.set_defaults(suite_command=run_own)


def _add_show(parser: argparse.ArgumentParser) -> None:
    _add_suite(parser)
    _add_task(parser)


def _add_suite(parser: argparse.ArgumentParser) -> None:
    about = "a suite's file (.yaml), or a suite of this library: standard"
    parser.add_argument("suite", metavar="SUITE", help=about)


def _add_task(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--task",
        nargs="+",
        default=(),
        metavar="MODULE:ID",
        help="tasks of the suite that no installed package lists, whose modules are imported",
    )


def _add_run(parser: argparse.ArgumentParser) -> None:
    _add_suite(parser)
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR", help=_FOLDER)
    _add_policy(parser, "as the suite says, else the experts")
    add("--only", nargs="+", default=(), metavar="CASE", help="play these cases or tasks alone")
    workers.add_arguments(parser)


def _add_report(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("folders", nargs="+", type=Path, metavar="DIR", help=f"{_FOLDER}; several are compared")
    page = "the HTML file (report.html in the first folder)"
    add("--out", type=Path, metavar="PAGE", help=page)
    _add_task(parser)


def _add_verify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help=_FOLDER)
    _add_policy(parser, "the experts")
    _add_task(parser)
    workers.add_arguments(parser)


def _add_policy(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--policy",
        nargs="+",
        metavar="[TASK=]MODULE:NAME",
        help="a policy that can be imported, or 'expert': of one task, or of all that are not named"
        f" ({default})",
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If a suite, a run or a policy makes no sense.
    """
    try:
        with stop_signals():
            return options.suite_command(options)
    except KeyboardInterrupt:
        goes_on = "; the same command goes on from there" if options.suite_command is _run else ""
        print(f"stopped{goes_on}", file=sys.stderr)
        return INTERRUPTED


def _show(options: argparse.Namespace) -> int:
    from rollouts.suite.files import load_suite

    _import_tasks(options)
    suite = load_suite(options.suite)
    print(printable(str(suite)))
    print(f"SHA-256: {suite.hash}")
    return 0


def _run(options: argparse.Namespace) -> int:
    from rollouts.progress import LiveLine
    from rollouts.suite.files import load_suite
    from rollouts.suite.run import chosen_cases, run_suite
    from rollouts.suite.tables import summary

    suite = load_suite(options.suite, import_tasks=True)
    cases = chosen_cases(suite, options.only)
    with LiveLine(sum(len(case.seeds) for case in cases), "episodes") as line:
        found = run_suite(
            suite,
            options.out,
            _policies(options.policy),
            only=options.only,
            executor=workers.chosen_executor(options),
            on_event=_Status(line).show,
        )
    for sentence in summary(found):
        print(printable(sentence))
    return 0


def _report(options: argparse.Namespace) -> int:
    from robots.common.writing import write_whole
    from rollouts.suite.page import read_runs, render_markdown, render_page

    _import_tasks(options)
    runs = read_runs(options.folders)
    page: Path = options.out or options.folders[0] / "report.html"
    write_whole(page, render_page(runs))
    write_whole(page.with_suffix(".md"), render_markdown(runs))
    print(printable(f"{page}, {page.with_suffix('.md')}"))
    return 0


def _verify(options: argparse.Namespace) -> int:
    from rollouts.progress import LiveLine
    from rollouts.suite.folder import read_run
    from rollouts.suite.run import verify_run

    _import_tasks(options)
    run = read_run(options.folder)
    episodes = sum(len(receipt.episodes) for receipt in run.receipts.values())
    with LiveLine(episodes, "episodes") as line:
        found = verify_run(
            run,
            _policies(options.policy),
            executor=workers.chosen_executor(options),
            on_event=_Status(line).show,
        )
    for name, verification in found.items():
        print(printable(f"{name}: {verification}"))
    equal = sum(verification.equal for verification in found.values())
    missing = len(run.missing)
    words = f"{missing} case{' was' if missing == 1 else 's were'} not played"
    print(f"{equal} of {len(found)} receipts verified; {words}")
    return 0 if equal == len(found) and found else 1


def _import_tasks(options: argparse.Namespace) -> None:
    """Import the modules of tasks that were named on the command line."""
    from tasks import get_task_class

    for name in options.task:
        get_task_class(name)


def _policies(words: list[str] | None) -> dict[str, str] | None:
    """Return policies by task.

    Raises:
        TaskError: If a task is given twice.
    """
    from robots import TaskError
    from rollouts.suite.files import OTHERS

    if words is None:
        return None
    found: dict[str, str] = {}
    for word in words:
        task, _, policy = word.rpartition("=")
        if (task or OTHERS) in found:
            raise TaskError(f"the policy of {task or OTHERS} is given twice")
        found[task or OTHERS] = policy
    return found


_COMMANDS = {
    "show": ("print what a suite plays, and its hash", None, _add_show, _show),
    "run": (
        "play a suite in worker processes; a receipt for each case",
        RUN_EPILOG,
        _add_run,
        _run,
    ),
    "report": (
        "write what runs of one suite amount to: an HTML page, and Markdown beside it",
        None,
        _add_report,
        _report,
    ),
    "verify": (
        "play every episode of a run again, and compare every state",
        VERIFY_EPILOG,
        _add_verify,
        _verify,
    ),
}


class _Status:
    """How far it is, over all cases."""

    def __init__(self, line: LiveLine) -> None:
        self._line = line
        self._played = self._solved = self._before = 0

    def show(self, case: Case, event: Event | None) -> None:
        """Tell what has come of the episodes so far."""
        if event is None:
            self._before += len(case.seeds)
            self._line.say(f"{case.name} was played before")
            return
        if event.news is not None:
            self._line.say(event.news)
        if event.result is not None:
            self._played += 1
            self._solved += event.result.success
        words = f"{case.name} (succeeded so far: {self._solved})"
        self._line.update(self._before + self._played, words)
