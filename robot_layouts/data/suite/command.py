"""``robot-layouts suite``: tasks × seeds × layouts in one file, played, reported, verified."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Count, Folder, Natural, Word
from robot_layouts.core.commands import printable
from robot_layouts.data.playing.command_options import GOES_ON, Players, stoppable, tell

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.scheduler import Event
    from robot_layouts.data.suite.checked import CheckedRun
    from robot_layouts.data.suite.page import WorstSeed
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
    out: Folder | None = None,
    episodes: Count = 3,
    clips: Natural = 0,
    policy: Sequence[Annotated[str, Word("MODULE:NAME|ws://HOST:PORT|hub:OWNER/NAME")]] = (),
    task: Tasks = (),
    players: Players,
) -> int:
    """Play some episodes of runs again, and write a page of those that are what they say.

    The folder has the page, index.html, the same tables as report.md, and all receipts that it
    shows. Results of policies that are not named stand apart, as not verified here, and nothing of
    them is imported. Exit code: 0 if the page was written; 1 if not, or if a result could not be
    listed; 2 for bad usage, 130 if interrupted.

    Args:
        folders: The folder of a run; those of one suite are compared.
        out: Where to write it (report in the first folder).
        episodes: Play N of each receipt, drawn at random.
        clips: Film the N seeds of each suite at which most runs failed; needs a graphics driver
            and the extra video.
        policy: Policies that may be imported or asked, as receipts name them.
        task: Tasks of the suite that no installed package lists, whose modules are imported.
        players: Who plays.

    Raises:
        RobotLayoutsError: If a run cannot be read, or the page not be written.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.suite import page
    from robot_layouts.data.suite.checked import check_run

    _import_tasks(task)
    out = out or folders[0] / "report"
    page.expect_place(out)
    executor, line = players.executor(), Progress(len(folders), "runs")

    def show(case: Case, event: Event) -> None:
        tell(line, event)
        line.advance(0, f"{case.name}, seed {event.seed}")

    with stoppable(), line:
        found = []
        for folder in folders:
            found.append(check_run(folder, episodes, policy, executor=executor, on_event=show))
            line.advance(1, f"{folder} is checked")
        checked = page.named_apart(found)
        films, remark = _films(page.by_suite(checked), clips, line)
        page.write_page(out, checked, films, remark)
    wrong = [f"{one.run.folder.name}, {w}" for one in checked for w in one.wrong]
    for what in wrong:
        print(printable(f"not listed: {what}"))
    print(printable(str(out / page.PAGE)))
    return 1 if wrong else 0


def _films(
    suites: Sequence[Sequence[CheckedRun]], count: int, line: Progress
) -> tuple[list[WorstSeed], str]:
    """Return films of the worst seeds of each suite, or why there are none."""
    from robot_layouts.data.suite.page import film_worst
    from robot_layouts.data.video import video_problem

    if not count:
        return [], ""
    shown = [[one.run for one in several if one.run.receipts] for several in suites]
    receipts = [receipt for runs in shown for run in runs for receipt in run.receipts.values()]
    for simulator in {receipt.making["simulator"] for receipt in receipts}:
        if problem := video_problem(simulator):
            return [], f"There are no clips: {problem}."
    return [
        film
        for runs in filter(None, shown)
        for film in film_worst(runs, count, lambda what: line.advance(0, what))
    ], ""


def verify(
    folder: RunFolder,
    *,
    episodes: Count | None = None,
    policy: Policies = (),
    task: Tasks = (),
    players: Players,
) -> int:
    """Play every episode of a run again, and compare every state.

    Exit code: 0 if every episode is equal to the last bit, 1 if not, 2 for bad usage, 130 if
    interrupted.

    Args:
        folder: The folder of a run.
        episodes: Play N of each receipt alone, drawn at random (all).
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
    counts = [len(receipt.episodes) for receipt in played.receipts.values()]
    total = sum(min(count, episodes or count) for count in counts)
    with stoppable(), Progress(total, "episodes") as line:
        found = verify_run(
            played,
            _policies(policy),
            episodes=episodes,
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
