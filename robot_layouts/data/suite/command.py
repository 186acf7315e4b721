"""``robot-layouts suite``: tasks × seeds × layouts in one file, played, reported, verified."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Word
from robot_layouts.core.commands import printable
from robot_layouts.data.playing.command_options import GOES_ON, Players, stoppable, tell

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.scheduler import Event
    from robot_layouts.data.suite.suite import Case

SuiteName = Annotated[str, Word("SUITE")]
RunFolder = Annotated[Path, Word("DIR")]
Tasks = Sequence[Annotated[str, Word("MODULE:ID")]]
Policies = Sequence[Annotated[str, Word("[TASK=]MODULE:NAME")]]


def show(suite: SuiteName, *, task: Tasks = ()) -> None:
    """Print what a suite plays, and its hash.

    Args:
        suite: A suite's file (.yaml), or a suite of this library: standard.
        task: Tasks of the suite that no installed package lists, whose modules are imported.

    Raises:
        RobotLayoutsError: If there is no such suite, or it is invalid.
    """
    from robot_layouts.data.suite.suite import load_suite

    _import_tasks(task)
    loaded = load_suite(suite)
    print(printable(str(loaded)))
    print(f"SHA-256: {loaded.hash}")


def run(
    suite: SuiteName,
    *,
    out: RunFolder,
    policy: Policies = (),
    only: Sequence[Annotated[str, Word("CASE")]] = (),
    players: Players,
) -> None:
    """Play a suite in worker processes; a receipt for each case.

    The same command goes on where it was stopped: what has a receipt is not played again. Exit
    code: 0 if all was played, 1 if not, 2 for bad usage, 130 if interrupted.

    Args:
        suite: A suite's file (.yaml), or a suite of this library: standard.
        out: The folder of a run.
        policy: A policy that can be imported, or 'expert': of one task, or of all that are not
            named (as the suite says, else the experts).
        only: Play these cases or tasks alone.
        players: Who plays.

    Raises:
        RobotLayoutsError: If a suite or a policy is invalid.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.suite.report import summary
    from robot_layouts.data.suite.run import chosen_cases, run_suite
    from robot_layouts.data.suite.suite import load_suite

    loaded = load_suite(suite, import_tasks=True)
    episodes = sum(len(case.seeds) for case in chosen_cases(loaded, only))
    with stoppable(lambda: GOES_ON), Progress(episodes, "episodes") as line:
        found = run_suite(
            loaded,
            out,
            _policies(policy),
            only=only,
            executor=players.executor(),
            on_event=_shower(line),
        )
    for sentence in summary(found):
        print(printable(sentence))


def report(
    folders: Sequence[RunFolder],
    *,
    out: Annotated[Path, Word("PAGE")] | None = None,
    task: Tasks = (),
) -> None:
    """Write what runs of one suite amount to: an HTML page, and Markdown beside it.

    Args:
        folders: The folder of a run; several are compared.
        out: The HTML file (report.html in the first folder).
        task: Tasks of the suite that no installed package lists, whose modules are imported.

    Raises:
        RobotLayoutsError: If a run cannot be read, or the page not be written.
    """
    from robot_layouts.core.writing import write_whole
    from robot_layouts.data.suite.report import read_runs, render_markdown, render_page

    _import_tasks(task)
    runs = read_runs(folders)
    page = out or folders[0] / "report.html"
    write_whole(page, render_page(runs))
    write_whole(page.with_suffix(".md"), render_markdown(runs))
    print(printable(f"{page}, {page.with_suffix('.md')}"))


def verify(folder: RunFolder, *, policy: Policies = (), task: Tasks = (), players: Players) -> int:
    """Play every episode of a run again, and compare every state.

    Exit code: 0 if every episode is equal to the last bit, 1 if not, 2 for bad usage, 130 if
    interrupted.

    Args:
        folder: The folder of a run.
        policy: A policy that can be imported, or 'expert': of one task, or of all that are not
            named (the experts).
        task: Tasks of the suite that no installed package lists, whose modules are imported.
        players: Who plays.

    Raises:
        RobotLayoutsError: If a run or a policy is invalid.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.suite.run import read_run, verify_run

    _import_tasks(task)
    played = read_run(folder)
    episodes = sum(len(receipt.episodes) for receipt in played.receipts.values())
    with stoppable(), Progress(episodes, "episodes") as line:
        found = verify_run(
            played,
            _policies(policy),
            executor=players.executor(),
            on_event=_shower(line),
        )
    for name, verification in found.items():
        print(printable(f"{name}: {verification}"))
    equal = sum(verification.equal for verification in found.values())
    missing = len(played.missing)
    words = f"{missing} case{' was' if missing == 1 else 's were'} not played"
    print(f"{equal} of {len(found)} receipts verified; {words}")
    return 0 if equal == len(found) and found else 1


def _import_tasks(names: Sequence[str]) -> None:
    """Import the modules of tasks that were named on the command line."""
    from tasks import get_task_class

    for name in names:
        get_task_class(name)


def _policies(words: Sequence[str]) -> dict[str, str] | None:
    """Return policies by task.

    Raises:
        TaskError: If a task is given twice.
    """
    from robot_layouts.data.suite.suite import OTHERS
    from robots import TaskError

    if not words:
        return None
    found: dict[str, str] = {}
    for word in words:
        task, _, policy = word.rpartition("=")
        if (task or OTHERS) in found:
            raise TaskError(f"the policy of {task or OTHERS} is given twice")
        found[task or OTHERS] = policy
    return found


def _shower(line: Progress) -> Callable[[Case, Event | None], None]:
    """Return what shows how far all cases are."""
    before, solved = 0, Counter[bool]()

    def show(case: Case, event: Event | None) -> None:
        nonlocal before
        if event is None:
            before += len(case.seeds)
            line.say(f"{case.name} was played before")
            return
        tell(line, event)
        if event.result is not None:
            solved[event.result.success] += 1
        words = f"{case.name} (succeeded so far: {solved[True]})"
        line.update(before + solved.total(), words)

    return show
