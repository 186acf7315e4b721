"""``robot-layouts parity tables``: the records as tables in docs, and their check."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from measurements.bench import tables as bench_table
from parity.compare.results import RESULTS, ResultsError, read
from parity.compare.task_summary import REWARD_MODES, number_text, reward_text, success_text
from robots import RobotLayoutsError
from robots.common.writing import write_whole
from tasks import list_clones

DOCS = Path(__file__).parents[1] / "docs"
PAGE, BENCHMARKS = DOCS / "parity.md", DOCS / "benchmarks.md"
PARITY_TABLE, BENCH_TABLES = "parity table", "benchmarks"  # what the markers call them
DIFFERENCES = ("object pose", "qpos", "observation")  # the rest stands in the record


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Writes what `robot-layouts parity compare --all --record` and `robot-layouts parity bench"
        " --record` found into docs/parity.md, and all of the latter into docs/benchmarks.md."
    )
    add = parser.add_argument
    add("--check", action="store_true", help="write nothing, and exit with 1 if a page is stale")
    add("--page", type=Path, default=PAGE, help="the page (this project's)")
    add("--benchmarks", type=Path, default=BENCHMARKS, help="the page of all benchmarks")
    add("--results", type=Path, default=RESULTS, help="the comparison (this project's)")
    add("--bench", type=Path, default=bench_table.RECORD, help="the benchmarks (this project's)")


def run(args: argparse.Namespace) -> int:
    """Run the command.

    Returns:
        0 if the pages show the records, 1 if a check finds that it does not or that the record
        of parity does not hold exactly the tasks there are, 2 if a file cannot be read.
    """
    try:
        record, measured = read(args.results), bench_table.read(args.bench)
        text = _read_text(args.page)
        fresh = with_lines(text, PARITY_TABLE, _lines(markdown(record), "make parity"))
        shown = _lines(bench_table.markdown(measured), bench_table.COMMAND)
        pages = {
            args.page: (text, with_lines(fresh, BENCH_TABLES, shown)),
            args.benchmarks: (_text_or_nothing(args.benchmarks), bench_table.page(measured)),
        }
        stale = {page: fresh for page, (text, fresh) in pages.items() if fresh != text}
        if not args.check:
            for page, fresh in stale.items():
                write_whole(page, fresh)
    except (RobotLayoutsError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    complaints = list(missing_and_extra(record["tasks"], list_clones()))
    if args.check:
        complaints += [f"{page.name} is stale; run `robot-layouts parity tables`" for page in stale]
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if args.check and complaints else 0


def begin(name: str) -> str:
    """Return the line after which something generated stands."""
    return f"<!-- {name}: begin; written by `robot-layouts parity tables` -->"


def end(name: str) -> str:
    """Return the line before which something generated stands."""
    return f"<!-- {name}: end -->"


def with_lines(page: str, name: str, lines: Iterable[str]) -> str:
    """Return a page with lines between the two markers of a name.

    Raises:
        ResultsError: If there is not exactly one of each marker, in order.
    """
    for marker in (begin(name), end(name)):
        if page.count(marker) != 1:
            raise ResultsError(
                f"the page has the line {marker!r} {page.count(marker)} times; it needs it once"
            )
    before, _, rest = page.partition(begin(name))
    if end(name) not in rest:
        raise ResultsError(f"the page has the line {end(name)!r} before {begin(name)!r}")
    _, _, after = rest.partition(end(name))
    return "\n".join([f"{before}{begin(name)}", "", *lines, "", f"{end(name)}{after}"])


def markdown(record: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the parity table, a row per task, and what it was measured with."""
    modes = [f"reward, {mode}" for mode in REWARD_MODES]
    numbers = ("obs", "actions", "episodes", "steps", "contact steps", *DIFFERENCES, *modes)
    last = ("success and info", "succeeded native / here")
    yield _row("task", "robots", *numbers, *last)
    yield _row("---", "---", *["---:"] * (len(numbers) + len(last)))
    for task, found in record["tasks"].items():
        counts = ("observation_size", "action_size", "episodes", "steps", "contact_steps")
        yield _row(
            f"`{task}`",
            found["robots"],
            *(str(found[count]) for count in counts),
            *(number_text(found["max_difference"][quantity]) for quantity in DIFFERENCES),
            *(reward_text(found, mode) for mode in REWARD_MODES),
            number_text(found["max_difference"]["info"]),
            success_text(found),
        )
    versions = ", ".join(f"{package} {v}" for package, v in record["versions"].items())
    yield ""
    yield f"Measured on {record['machine']} with {versions}."


def missing_and_extra(recorded: Iterable[str], tasks: Iterable[str]) -> Iterator[str]:
    """Yield a complaint if tasks are not in the record, and one if it holds what is no task."""
    recorded, tasks = set(recorded), set(tasks)
    if tasks - recorded:
        yield f"the record lacks {', '.join(sorted(tasks - recorded))}; run `make parity`"
    if recorded - tasks:
        extra = ", ".join(sorted(recorded - tasks))
        yield f"the record holds {extra}, which no task is called; run `make parity`"


def _lines(lines: Iterable[str], command: str) -> list[str]:
    """Return what is generated from a record.

    Raises:
        ResultsError: If the record lacks something that it shows.
    """
    try:
        return list(lines)
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"the record is not complete: {error!r}; run `{command}`") from error


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _text_or_nothing(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ResultsError(
            f"cannot read {path}: {error.strerror}; it lies in a checkout"
        ) from error
