"""The tables of a suite's report, in words, for the page and for Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from robots.common.pages import plural
from rollouts.receipts.receipt import Receipt
from rollouts.sources.policies import EXPERT
from rollouts.suite.folder import SuiteRun
from rollouts.suite.results import Comparison, Interval, Result, compare, overall, result_of
from rollouts.suite.suite import SHORT

ALL = "all"  # the row of all cases together
NONE = "–"
LETTERS = "ABCDEFGH"  # of runs that stand side by side

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


@dataclass(frozen=True)
class Table:
    """Names of columns, and rows, the first column of which says what a row is of."""

    names: tuple[str, ...]
    rows: Rows


def results_of(runs: Sequence[SuiteRun]) -> dict[str, list[Result | None]]:
    """Return how each run did, by case; `ALL` together last, of runs that played anything."""
    cases = [case.name for case in runs[0].suite.cases]
    found = {name: [_result(run.receipts.get(name)) for run in runs] for name in cases}
    return {**found, ALL: [overall(list(run.receipts.values())) for run in runs]}


def successes(runs: Sequence[SuiteRun]) -> Table:
    """Return the success rate of each case, by run."""
    names = ("case", *(_column(runs, number, "success") for number in _numbers(runs)), "episodes")
    rows = [
        (name, *map(_rate, results), _episodes(results))
        for name, results in results_of(runs).items()
    ]
    return Table(names, rows)


def lengths(runs: Sequence[SuiteRun]) -> Table:
    """Return lengths and returns of each case, by run."""
    names = ["case"]
    for number in _numbers(runs):
        names += [_column(runs, number, what) for what in ("steps", "from, to", "return")]
    rows = [
        (name, *(cell for result in results for cell in _length(result)))
        for name, results in results_of(runs).items()
        if name != ALL
    ]
    return Table(tuple(names), rows)


def comparisons(runs: Sequence[SuiteRun]) -> Iterator[tuple[str, Table]]:
    """Yield a title and a table for each run but the first, which it is compared with."""
    for number in _numbers(runs)[1:]:
        one, other = runs[number], runs[0]
        both = [name for name in other.receipts if name in one.receipts]
        if both:
            names = ("case", f"only {LETTERS[number]}", f"only {LETTERS[0]}")
            found = compare([(one.receipts[name], other.receipts[name]) for name in both])
            rows = [(n, *_compared(c)) for n, c in zip([*both, ALL], found, strict=True)]
            title = f"{LETTERS[number]} beside {LETTERS[0]}, seed by seed"
            yield (
                title,
                Table((*names, "difference", "95 % interval", "p", "p (Holm)"), rows),
            )


def failures(runs: Sequence[SuiteRun]) -> Table:
    """Return which seeds failed, and why if that is known."""
    rows = [
        (LETTERS[number], name, *_failed(receipt))
        for number in _numbers(runs)
        for name, receipt in runs[number].receipts.items()
        if receipt.success_rate < 1
    ]
    return Table(("run", "case", "failed", "seeds", "reasons"), rows)


def players(runs: Sequence[SuiteRun]) -> Table:
    """Return who played, where, and on what."""
    rows = [
        (LETTERS[number], runs[number].folder.resolve().name, *player)
        for number in _numbers(runs)
        for player in _players(runs[number])
    ]
    return Table(("run", "folder", "policy", "played", "SHA-256 begins", "on"), rows)


def receipts(runs: Sequence[SuiteRun]) -> Table:
    """Return how the hash of each receipt begins."""
    names = ("case", *(_column(runs, number, "receipt") for number in _numbers(runs)))
    rows = [
        (case.name, *(_short_hash(run.receipts.get(case.name)) for run in runs))
        for case in runs[0].suite.cases
    ]
    return Table(names, rows)


def percent(share: float) -> str:
    """Return a share in percent, without the sign."""
    return f"{100 * share:.1f}"


def _result(receipt: Receipt | None) -> Result | None:
    return None if receipt is None else result_of(receipt.episodes)


def _numbers(runs: Sequence[SuiteRun]) -> range:
    return range(len(runs))


def _column(runs: Sequence[SuiteRun], number: int, what: str) -> str:
    return what if len(runs) == 1 else f"{LETTERS[number]}: {what}"


def _episodes(results: Sequence[Result | None]) -> str:
    counts = {f"{result.episodes:,}" for result in results if result is not None}
    return " / ".join(sorted(counts)) or NONE


def _rate(result: Result | None) -> str:
    if result is None:
        return NONE
    return f"{percent(result.rate)} ({_interval(result.interval)})"


def _interval(interval: Interval, sign: str = "") -> str:
    low, high = (f"{100 * end:{sign}.1f}".replace("-", "−") for end in interval)
    return f"{low} to {high}"


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


def _players(run: SuiteRun) -> Sequence[tuple[str, str, str, str]]:
    """Return each policy, the cases that it played, its source, and what it was played on."""
    cases: dict[tuple[str, str, str], list[str]] = {}
    for name, receipt in run.receipts.items():
        policy, digest = receipt.policy, receipt.policy.get("sha256") or NONE
        own = policy["name"] if policy["kind"] != EXPERT else EXPERT
        digest = NONE if own == EXPERT else digest[:SHORT]
        cases.setdefault((own, digest, _played_on(receipt)), []).append(name)
    return [
        (policy, plural(len(names), "case"), digest, machine)
        for (policy, digest, machine), names in cases.items()
    ]


def _played_on(receipt: Receipt) -> str:
    """Return the versions that a paper would name, and the processor."""
    versions, processor = (receipt.environment[name] for name in ("versions", "processor"))
    known = [f"{name} {versions[name]}" for name in _NAMED if name in versions]
    return ", ".join([*known, *filter(None, [processor.get("name")])])


def _short_hash(receipt: Receipt | None) -> str:
    return NONE if receipt is None else receipt.hash[:16]


def summary(run: SuiteRun) -> Iterator[str]:
    """Yield what came of a run, a line for each case."""
    suite = run.suite
    yield f"{suite.name} {suite.id} in {run.folder}"
    table = successes([run])
    width = max(len(row[0]) for row in table.rows)
    for name, rate, episodes in table.rows:
        yield (
            f"  {name:<{width}}  {rate} % of {episodes}"
            if rate != NONE
            else (f"  {name:<{width}}  not played")
        )
