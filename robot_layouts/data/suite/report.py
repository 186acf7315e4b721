"""The report of runs of suites: tables as texts, on one HTML page and the same as Markdown."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from string import ascii_uppercase

from robot_layouts.core.pages import plural
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.receipts.receipt import Receipt
from robot_layouts.data.suite.results import (
    Comparison,
    Interval,
    Result,
    compare,
    overall,
    result_of,
)
from robot_layouts.data.suite.run import SuiteRun
from robot_layouts.data.suite.suite import SHORT

ALL = "all"  # the row of all cases together
NONE = "–"
LETTERS = ascii_uppercase  # of runs that stand side by side

INTERVALS = (
    "Shares of episodes that ended in success, in percent, with 95 % confidence intervals (Wilson's"
    " score interval). The same seeds give the same episodes again, to the last bit; the intervals"
    " say what to expect of other seeds."
)
PAIRED = (
    "Both played the same seeds, so they are compared seed by seed: McNemar's exact test asks how"
    " probable so uneven a split of the seeds that only one of them solved would be if both were"
    " equally good (p; by Holm's procedure for all cases, so that many cases raise no false alarm),"
    " and the 95 % interval of the difference is Bonett and Price's for paired rates, an"
    " approximation if seeds are few."
)

_SHOWN, _REASONS = 10, 3  # seeds and reasons that a row names
_NAMED = ("robot-layouts", "sapien", "torch", "numpy", "python")  # versions

Rows = Sequence[tuple[str, ...]]

_MARKUP = re.compile(r"[\\`*_\[\]!|~]|(?<=:)/|(?<=www)\.", re.IGNORECASE)


@dataclass(frozen=True)
class ReportTable:
    """Names of columns, and rows, the first column of which says what a row is of."""

    names: tuple[str, ...]
    rows: Rows


def results_of(runs: Sequence[SuiteRun]) -> dict[str, list[Result | None]]:
    """Return how each run did, by case; `ALL` together last, of runs that played anything."""
    played = [run.receipts for run in runs]
    found: dict[str, list[Result | None]] = {
        case.name: [result_of(r[case.name].episodes) if case.name in r else None for r in played]
        for case in runs[0].suite.cases
    }
    return {**found, ALL: [overall(list(receipts.values())) for receipts in played]}


def successes(runs: Sequence[SuiteRun]) -> ReportTable:
    """Return the success rate of each case, by run."""
    rows: list[tuple[str, ...]] = []
    for name, results in results_of(runs).items():
        counts = {f"{result.episodes:,}" for result in results if result is not None}
        rates = map(rate, results)
        rows.append((name, *rates, " / ".join(sorted(counts)) or NONE))
    return ReportTable(("case", *_columns(runs, "success"), "episodes"), rows)


def lengths(runs: Sequence[SuiteRun]) -> ReportTable:
    """Return lengths and returns of each case, by run."""
    results = {name: found for name, found in results_of(runs).items() if name != ALL}
    rows = [
        (name, *(cell for result in found for cell in _length(result)))
        for name, found in results.items()
    ]
    return ReportTable(("case", *_columns(runs, "steps", "from, to", "return")), rows)


def comparisons(runs: Sequence[SuiteRun]) -> Iterator[tuple[str, ReportTable]]:
    """Yield a title and a table for each run but the first, which it is compared with."""
    other = runs[0]
    for letter, one in list(zip(LETTERS, runs, strict=False))[1:]:
        both = [name for name in other.receipts if name in one.receipts]
        if both:
            found = compare([(one.receipts[name], other.receipts[name]) for name in both])
            rows = [(n, *_compared(c)) for n, c in zip([*both, ALL], found, strict=True)]
            names = ("case", f"only {letter}", f"only {LETTERS[0]}", "difference")
            title = f"{letter} beside {LETTERS[0]}, seed by seed"
            yield title, ReportTable((*names, "95 % interval", "p", "p (Holm)"), rows)


def failures(runs: Sequence[SuiteRun]) -> ReportTable:
    """Return which seeds failed, and why if that is known."""
    rows = [
        (letter, name, *_failed(receipt))
        for letter, run in zip(LETTERS, runs, strict=False)
        for name, receipt in run.receipts.items()
        if receipt.success_rate < 1
    ]
    return ReportTable(("run", "case", "failed", "seeds", "reasons"), rows)


def players(runs: Sequence[SuiteRun]) -> ReportTable:
    """Return who played, where, and on what."""
    rows: list[tuple[str, ...]] = []
    for letter, run in zip(LETTERS, runs, strict=False):
        cases = Counter(_player(receipt) for receipt in run.receipts.values())
        rows += [
            (letter, run.folder.resolve().name, policy, plural(count, "case"), digest, machine)
            for (policy, digest, machine), count in cases.items()
        ]
    return ReportTable(("run", "folder", "policy", "played", "SHA-256 begins", "on"), rows)


def receipts(runs: Sequence[SuiteRun]) -> ReportTable:
    """Return how the hash of each receipt begins."""
    rows = [
        (
            case.name,
            *(r.hash[:16] if (r := run.receipts.get(case.name)) else NONE for run in runs),
        )
        for case in runs[0].suite.cases
    ]
    return ReportTable(("case", *_columns(runs, "receipt")), rows)


def percent(share: float) -> str:
    """Return a share in percent, without the sign."""
    return f"{100 * share:.1f}"


def _columns(runs: Sequence[SuiteRun], *names: str) -> list[str]:
    """Return the names of columns of each run, with its letter where there are several."""
    if len(runs) == 1:
        return list(names)
    return [f"{letter}: {name}" for letter in LETTERS[: len(runs)] for name in names]


def _interval(interval: Interval, sign: str = "") -> str:
    low, high = (f"{100 * end:{sign}.1f}".replace("-", "−") for end in interval)
    return f"{low} to {high}"


def rate(result: Result | None) -> str:
    """Return a success rate in percent with its interval, and the mean score of stages."""
    if result is None:
        return NONE
    words = f"{percent(result.rate)} ({_interval(result.interval)})"
    return words if result.stage_score is None else f"{words}, stages {result.stage_score:.2f}"


def _length(result: Result | None) -> tuple[str, str, str]:
    if result is None:
        return NONE, NONE, NONE
    least, most = result.lengths
    return f"{result.length:g}", f"{least} to {most}", f"{result.total:.2f}"


def _compared(c: Comparison) -> tuple[str, ...]:
    difference = f"{100 * c.difference:+.1f}".replace("-", "−") if c.difference else "0.0"
    p = (_probability(c.p), _probability(c.adjusted))
    return f"{c.gained:,}", f"{c.lost:,}", difference, _interval(c.interval, "+"), *p


def _probability(p: float) -> str:
    return "< 0.0001" if p < 0.0001 else f"{p:.2g}" if p < 0.1 else f"{p:.2f}"


def _failed(receipt: Receipt) -> tuple[str, str, str]:
    """Return how many episodes failed, which, and why; the most frequent reason first."""
    failed = [episode for episode in receipt.episodes if not episode.success]
    seeds = ", ".join(str(episode.seed) for episode in failed[:_SHOWN])
    more = ", …" if len(failed) > _SHOWN else ""
    reasons = Counter(episode.reason for episode in failed if episode.reason)
    words = "; ".join(f"{count} × {reason}" for reason, count in reasons.most_common(_REASONS))
    return f"{len(failed):,}", f"{seeds}{more}", words or NONE


def _player(receipt: Receipt) -> tuple[str, str, str]:
    """Return who played, its source, and the versions and processor that a paper would name."""
    policy = receipt.policy
    versions, processor = (receipt.environment[name] for name in ("versions", "processor"))
    known = [f"{name} {versions[name]}" for name in _NAMED if name in versions]
    machine = ", ".join([*known, *filter(None, [processor.get("name")])])
    if policy["kind"] == EXPERT:
        return EXPERT, NONE, machine
    return policy["name"], (policy.get("sha256") or NONE)[:SHORT], machine


def summary(run: SuiteRun) -> Iterator[str]:
    """Yield the success of a run, a line for each case."""
    suite = run.suite
    yield f"{suite.name} {suite.id} in {run.folder}"
    results = results_of([run])
    width = max(map(len, results))
    for name, (result,) in results.items():
        words = "not played"
        if result is not None:
            words = (
                f"{percent(result.rate)} ({_interval(result.interval)}) % of {result.episodes:,}"
            )
            words += "" if result.stage_score is None else f", stages {result.stage_score:.2f}"
        yield f"  {name:<{width}}  {words}"


def render_markdown(runs: Sequence[SuiteRun]) -> str:
    """Return the report's tables of runs of one suite, side by side, as Markdown."""
    suite = runs[0].suite
    lines = [f"# {suite.name} {suite.id}", "", f"{about(runs)} SHA-256: `{suite.hash}`.", ""]
    for title, words, shown, text in parts(runs):
        lines += [f"## {title}", "", *([words, ""] if words else []), *markdown(shown, text), ""]
    return "\n".join(lines)


def parts(runs: Sequence[SuiteRun]) -> Iterator[tuple[str, str, ReportTable, int]]:
    """Yield of each part its title, its words, a table, and how many columns of it are text."""
    yield "Success", INTERVALS, successes(runs), 1
    for title, found in comparisons(runs):
        yield title, PAIRED, found, 1
    words = "Steps are the median of all episodes and the range; the return is the mean."
    yield "Lengths and returns", words, lengths(runs), 1
    if (failed := failures(runs)).rows:
        yield "Failures", "", failed, 5
    yield "Who played", "", players(runs), 6
    words = "How the SHA-256 of each receipt begins; robot-layouts suite verify plays them again."
    yield "Receipts", words, receipts(runs), 1 + len(runs)


def about(runs: Sequence[SuiteRun]) -> str:
    """Return how large the suite of runs is, in a sentence."""
    suite = runs[0].suite
    count = f"{plural(len(suite.cases), 'case')}, {suite.episodes:,} episodes"
    return f"A suite of {count}, in {plural(len(runs), 'run')}."


def markdown(shown: ReportTable, text: int) -> Iterator[str]:
    """Yield the lines of a table whose first columns, as many as ``text``, hold text."""
    yield _row(shown.names)
    yield _row([("---" if place < text else "--:") for place in range(len(shown.names))])
    yield from map(_row, shown.rows)


def _row(cells: Sequence[str]) -> str:
    """Return a row, in which no cell is markup, nor a link to those who find links in texts."""
    plain = (escape(" ".join(cell.split()), quote=False) for cell in cells)
    return f"| {' | '.join(_MARKUP.sub(_entity, cell) for cell in plain)} |"


def _entity(found: re.Match[str]) -> str:
    return f"&#{ord(found[0])};"
