"""``--write-faults FILE`` counts the faults tried, as a page; ``--list-faults FILE`` lists them."""

from __future__ import annotations

import html
import re
import signal
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHOWN = 240  # characters of a message

Tried = dict[str, list[tuple[str, str, str, bool]]]
"""Area → what was tried, what is promised, what happened, and whether that is kept."""

HEADING = """\
# Faults

What was tried to break the library, what it promises then, and what happens. Written by
`make faults`, which tries all of it again: hostile files, wrong arguments, processes killed or
stopped, disks and networks that fail. "One clear error" means a `RobotLayoutsError` that says what
is wrong; "goes on" means that results are the same as without the fault, or that nothing was lost.
It also lists each of them, with what happens, in `runs/faults.md`.
"""


def pytest_configure() -> None:
    """Let signals end processes, also where this one was begun with some ignored, as by nohup."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-faults", metavar="FILE", help="write how many were tried to a page")
    parser.addoption("--list-faults", metavar="FILE", help="write the list of faults to a page")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    counts, everything = map(terminalreporter.config.getoption, ("write_faults", "list_faults"))
    if not counts and not everything:
        return
    tried: Tried = defaultdict(list)
    for outcome in ("passed", "failed"):
        for report in terminalreporter.stats.get(outcome, []):
            said = dict(report.user_properties)
            if "fault" in said:
                area, what, promise = said["fault"]
                happened = said.get("happened", _last_line(report))
                tried[area].append((what, promise, happened, outcome == "passed"))
    if not tried:  # a run that was stopped, or of none of them: the page stays
        return
    for path, page in ((counts, _totals(tried)), (everything, f"{_totals(tried)}{_list(tried)}")):
        if path:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_text(page, encoding="utf-8")
            terminalreporter.write_line(f"faults: {path}")
    broken = sum(not ok for rows in tried.values() for *_, ok in rows)
    terminalreporter.write_line(f"{sum(map(len, tried.values()))} faults, {broken} broken promises")


def _totals(tried: Tried) -> str:
    lines = [HEADING, "| area | tried | promises kept |", "| --- | ---: | ---: |"]
    for area, rows in sorted(tried.items()):
        lines.append(f"| {area} | {len(rows)} | {sum(ok for *_, ok in rows)} |")
    everything = [row for rows in tried.values() for row in rows]
    lines.append(f"| **all** | {len(everything)} | {sum(ok for *_, ok in everything)} |")
    return "\n".join(lines) + "\n"


def _list(tried: Tried) -> str:
    lines = list[str]()
    for area, rows in sorted(tried.items()):
        lines += ["", f"## {area[:1].upper()}{area[1:]}", ""]
        lines += ["| tried | promised | what happens |", "| --- | --- | --- |"]
        for what, promise, happened, ok in sorted(rows):
            broken = "" if ok else "**broken**: "
            lines.append(f"| {_cell(what)} | {promise} | {broken}{_cell(happened)} |")
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    text = re.sub(r"/\S*/pytest-of-\w+/pytest-\d+/", "…/", text.replace(str(ROOT), "…"))
    text = " ".join(text.split())
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    text = text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"
    return html.escape(text, quote=False).replace("|", "\\|").replace("`", "'")


def _last_line(report: pytest.TestReport) -> str:
    lines = str(report.longrepr).strip().splitlines()
    return next((line for line in reversed(lines) if line.startswith("E ")), lines[-1])
