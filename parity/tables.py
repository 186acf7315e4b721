"""``python -m parity tables``: the recorded comparison as a table of docs/parity.md."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from parity.results import (
    RESULTS,
    REWARD_MODES,
    ResultsError,
    number_text,
    read_results,
    reward_text,
    success_text,
)
from robot_layouts.core.writing import write_whole
from tasks import list_clones

PAGE = Path(__file__).parents[1] / "docs" / "parity.md"
NAME, COMMAND = "parity table", "python -m parity tables"
DIFFERENCES = ("object pose", "qpos", "observation")  # the rest stands in the record


def tables(*, check: bool = False, page: Path = PAGE, results: Path = RESULTS) -> int:
    """Write the recorded comparison with native into docs/parity.md.

    Args:
        check: Write nothing, and exit with 1 if the page is stale or the record lacks a task.
        page: The page.
        results: The record.

    Raises:
        ResultsError: If a file cannot be read.
        UnwritableFileError: If the page cannot be written.
    """
    record = read_results(results)
    try:
        text = "\n".join(markdown(record))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        why = f"the record is not complete: {error!r}; run `make parity`"
        raise ResultsError(why) from error
    status = update({page: replace_table(page, NAME, COMMAND, text)}, COMMAND, check=check)
    recorded, clones = {*record["tasks"]}, {*list_clones()}
    for names, what in (
        (clones - recorded, "lacks"),
        (recorded - clones, "holds what is no task:"),
    ):
        if names:
            print(
                f"the record {what} {', '.join(sorted(names))}; run `make parity`", file=sys.stderr
            )
            status = int(check)
    return status


def replace_table(page: Path, name: str, command: str, text: str) -> str:
    """Return a page with a text between the two markers of a name.

    Args:
        page: The page's file.
        name: What its markers call the text.
        command: What writes it, for the reader of the page.
        text: The text.

    Raises:
        ResultsError: If it cannot be read, or has not exactly one of each marker, in order.
    """
    begin, end = f"<!-- {name}: begin; written by `{command}` -->", f"<!-- {name}: end -->"
    try:
        before = page.read_text(encoding="utf-8")
    except OSError as error:
        raise ResultsError(f"cannot read {page}: {error.strerror}") from error
    for marker in (begin, end):
        if before.count(marker) != 1:
            count = before.count(marker)
            raise ResultsError(f"{page} has the line {marker!r} {count} times; it needs it once")
    if before.index(end) < before.index(begin):
        raise ResultsError(f"{page} has the line {end!r} before {begin!r}")
    return f"{before.partition(begin)[0]}{begin}\n\n{text}\n\n{end}{before.partition(end)[2]}"


def update(pages: Mapping[Path, str], command: str, *, check: bool) -> int:
    """Write those pages that are stale, or say which are.

    Args:
        pages: What each is to hold.
        command: What writes them.
        check: Whether to write nothing.

    Returns:
        1 if a page is stale and was not written, else 0.

    Raises:
        UnwritableFileError: If a page cannot be written.
    """
    stale = [
        page
        for page, text in pages.items()
        if not page.is_file() or page.read_text(encoding="utf-8") != text
    ]
    for page in stale:
        if check:
            print(f"{page.name} is stale; run `{command}`", file=sys.stderr)
        else:
            write_whole(page, pages[page])
    return int(check and bool(stale))


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


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"
