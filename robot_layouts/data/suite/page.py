"""The report of a suite's runs: one HTML page that needs nothing else, and the same as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from robot_layouts.core.pages import Tile, fragment, page, plural
from robot_layouts.data.suite import tables
from robot_layouts.data.suite.folder import SuiteRun, expect_untouched, read_run
from robot_layouts.data.suite.results import Result
from robot_layouts.data.suite.tables import ALL, INTERVALS, LETTERS, PAIRED, Table
from robots import TaskError

STYLE = ("robot_layouts.data.suite", "suite.css")

_MARKUP = re.compile(r"[\\`*_\[\]!|~]|(?<=:)/|(?<=www)\.", re.IGNORECASE)

_WIDTH, _ROW = 160, 12  # of a chart of intervals


def read_runs(folders: Sequence[Path]) -> list[SuiteRun]:
    """Return runs of one suite, to be shown side by side.

    Raises:
        TaskError: If they are of several suites, too many, or nothing was played.
        ReceiptError: If a receipt is damaged, or was changed.
    """
    if not 1 <= len(folders) <= len(LETTERS):
        raise TaskError(f"{len(folders)} runs were given; a report shows 1 to {len(LETTERS)}")
    runs = [expect_untouched(read_run(folder)) for folder in folders]
    for run in runs:
        if run.suite.hash != runs[0].suite.hash:
            names = " and ".join(f"{r.folder}: {r.suite.name} {r.suite.id}" for r in (runs[0], run))
            raise TaskError(f"runs of one suite can be compared; these are of two ({names})")
        if not run.receipts:
            raise TaskError(f"nothing has been played in {run.folder}; there is nothing to report")
    return runs


def render_page(runs: Sequence[SuiteRun]) -> str:
    """Return the report as HTML; see `read_runs`."""
    suite, results = runs[0].suite, tables.results_of(runs)
    total = zip(runs, results[ALL], strict=True)
    return page(
        "robot_layouts.data.suite/report.html.jinja",
        STYLE,
        kicker="robot-layouts, a suite",
        title=f"{suite.name} {suite.id}",
        note=_about(runs),
        tiles=[
            Tile("episodes", f"{suite.episodes:,}", f"{plural(len(suite.cases), 'case')}"),
            *(_tile(number, *of) for number, of in enumerate(total)),
        ],
        parts=[_shown(part, results) for part in _parts(runs)],
    )


def render_markdown(runs: Sequence[SuiteRun]) -> str:
    """Return the report's tables as Markdown; see `read_runs`."""
    suite = runs[0].suite
    lines = [f"# {suite.name} {suite.id}", "", f"{_about(runs)} SHA-256: `{suite.hash}`.", ""]
    for title, words, shown, text in _parts(runs):
        lines += [f"## {title}", "", *([words, ""] if words else []), *_markdown(shown, text), ""]
    return "\n".join(lines)


def _parts(runs: Sequence[SuiteRun]) -> Iterator[tuple[str, str, Table, int]]:
    """Yield of each part its title, its words, a table, and how many columns of it are text."""
    yield "Success", INTERVALS, tables.successes(runs), 1
    for title, found in tables.comparisons(runs):
        yield title, PAIRED, found, 1
    words = "Steps are the median of all episodes and the range; the return is the mean."
    yield "Lengths and returns", words, tables.lengths(runs), 1
    if (failed := tables.failures(runs)).rows:
        yield "Failures", "", failed, 5
    yield "Who played", "", tables.players(runs), 6
    words = "How the SHA-256 of each receipt begins; robot-layouts suite verify plays them again."
    yield "Receipts", words, tables.receipts(runs), 1 + len(runs)


def _shown(
    part: tuple[str, str, Table, int], results: Mapping[str, Sequence[Result | None]]
) -> dict[str, Any]:
    """Return a part as the page's template takes it; that of successes has a chart in each row."""
    title, words, shown, text = part
    names, rows = shown.names, shown.rows
    if title == "Success":
        names = (*names[:-1], "0 to 100 %", names[-1])
        rows = [(*row[:-1], _chart(results[row[0]]), row[-1]) for row in rows]
    return {"title": title, "words": words, "names": names, "rows": rows, "text": text}


def _tile(number: int, run: SuiteRun, result: Result | None) -> Tile:
    assert result is not None  # `read_runs` has seen to that
    note = f"{result.successes:,} of {result.episodes:,}"
    if run.missing:
        note += f"; {plural(len(run.missing), 'case')} not played"
    label = f"{LETTERS[number]}: success of {run.folder.resolve().name}"
    return Tile(label, f"{tables.percent(result.rate)} %", note)


def _about(runs: Sequence[SuiteRun]) -> str:
    suite = runs[0].suite
    count = f"{plural(len(suite.cases), 'case')}, {suite.episodes:,} episodes"
    return f"A suite of {count}, in {plural(len(runs), 'run')}."


def _chart(results: Sequence[Result | None]) -> str:
    """Return an interval for each run, drawn from 0 to 100 %."""
    whiskers = [
        {
            "place": place,
            "words": f"{LETTERS[place]}: {result.successes:,} of {result.episodes:,}",
            "y": _ROW * (place + 0.5),
            "low": _WIDTH * result.interval[0],
            "high": _WIDTH * result.interval[1],
            "rate": _WIDTH * result.rate,
        }
        for place, result in enumerate(results)
        if result is not None
    ]
    sizes = {"width": _WIDTH, "height": _ROW * len(results)}
    return fragment("robot_layouts.data.suite/intervals.svg.jinja", whiskers=whiskers, **sizes)


def _markdown(shown: Table, text: int) -> Iterator[str]:
    yield _row(shown.names)
    yield _row([("---" if place < text else "--:") for place in range(len(shown.names))])
    yield from map(_row, shown.rows)


def _row(cells: Sequence[str]) -> str:
    """Return a row, in which no cell is markup, nor a link to those who find links in texts."""
    plain = (escape(" ".join(cell.split()), quote=False) for cell in cells)
    return f"| {' | '.join(_MARKUP.sub(_entity, cell) for cell in plain)} |"


def _entity(found: re.Match[str]) -> str:
    return f"&#{ord(found[0])};"
