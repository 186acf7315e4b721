"""The statistics of a suite's runs: success rates with intervals, and paired comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import sqrt
from statistics import NormalDist, mean, median

from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt

Episodes = Sequence[EpisodeReceipt]

LEVEL = 0.95  # of all intervals
Z = NormalDist().inv_cdf((1 + LEVEL) / 2)

Interval = tuple[float, float]
"""Its lower and upper end."""


@dataclass(frozen=True)
class Result:
    """How some episodes went.

    Attributes:
        successes: Episodes that ended in success.
        episodes: All of them.
        interval: 95 % confidence interval of the success rate.
        length: Control steps, median.
        lengths: The fewest and the most.
        total: Return, mean.
        stage_score: Mean score of the last stages that they passed; None of a task without stages.
    """

    successes: int
    episodes: int
    interval: Interval
    length: float
    lengths: tuple[int, int]
    total: float
    stage_score: float | None = None

    @property
    def rate(self) -> float:
        """The share of episodes that ended in success."""
        return self.successes / self.episodes


@dataclass(frozen=True)
class Comparison:
    """How one policy did beside another, seed by seed.

    Attributes:
        gained: Seeds that it alone solved.
        lost: Seeds that the other alone solved.
        episodes: Seeds that both played.
        adjusted: `p`, by Holm's procedure for all cases; of all cases together, as it is.
    """

    gained: int
    lost: int
    episodes: int
    adjusted: float

    @property
    def difference(self) -> float:
        """Its success rate minus the other's."""
        return (self.gained - self.lost) / self.episodes

    @property
    def interval(self) -> Interval:
        """95 % confidence interval of that difference."""
        return paired_difference(self.gained, self.lost, self.episodes)

    @property
    def p(self) -> float:
        """The p-value of McNemar's exact test."""
        return mcnemar(self.gained, self.lost)


def result_of(episodes: Episodes) -> Result:
    """Return how episodes, one or more, went."""
    solved, steps = sum(one.success for one in episodes), [one.steps for one in episodes]
    return Result(
        solved,
        len(episodes),
        wilson(solved, len(episodes)),
        median(steps),
        (min(steps), max(steps)),
        mean(one.total for one in episodes),
        _stage_score(episodes),
    )


def _stage_score(episodes: Episodes) -> float | None:
    """Return the mean score of stages; an episode of no steps has passed none."""
    if all(one.stage_score is None for one in episodes):
        return None
    return mean(one.stage_score or 0.0 for one in episodes)


def overall(receipts: Sequence[Receipt]) -> Result | None:
    """Return how the episodes of all cases went; None if there are none.

    The interval takes them as draws from all cases alike. As each case has a fixed number of them,
    it is rather too wide than too narrow.
    """
    episodes = list(chain.from_iterable(one.episodes for one in receipts))
    return replace(result_of(episodes), stage_score=None) if episodes else None


def compare(pairs: Sequence[tuple[Receipt, Receipt]]) -> list[Comparison]:
    """Return how the first of each pair did beside the second, and last all of them together.

    Args:
        pairs: Receipts of one case, each played with the same seeds.
    """
    counts: list[tuple[int, int, int]] = []
    for one, other in pairs:
        solved = {episode.seed: episode.success for episode in other.episodes}
        both = [(e.success, solved[e.seed]) for e in one.episodes if e.seed in solved]
        counts.append((both.count((True, False)), both.count((False, True)), len(both)))
    adjusted = holm([mcnemar(gained, lost) for gained, lost, _ in counts])
    found = [Comparison(*of, p) for of, p in zip(counts, adjusted, strict=True)]
    gained, lost, episodes = (sum(column) for column in zip(*counts, strict=True))
    return [*found, Comparison(gained, lost, episodes, mcnemar(gained, lost))]


def wilson(successes: int, episodes: int) -> Interval:
    """Return the 95 % confidence interval of a success rate, Wilson's score interval.

    From E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    Journal of the American Statistical Association 22 (1927). It holds for few episodes, and for
    rates near 0 and 1, where mean ± 1.96 standard errors does not.
    """
    rate, share = successes / episodes, Z * Z / episodes
    middle = (rate + share / 2) / (1 + share)
    half = Z / (1 + share) * sqrt(rate * (1 - rate) / episodes + share / episodes / 4)
    low = 0.0 if successes == 0 else middle - half  # exactly, where rounding may miss it
    return low, 1.0 if successes == episodes else middle + half


def mcnemar(gained: int, lost: int) -> float:
    """Return the p-value of McNemar's exact test, two-sided.

    If two policies are equally good, each seed that only one of them solves is as likely to be
    either's: a fair coin. From Q. McNemar, "Note on the sampling error of the difference between
    correlated proportions or percentages", Psychometrika 12 (1947), with the binomial distribution
    itself in place of its approximation.

    Args:
        gained: Seeds that the one solves and the other does not.
        lost: Seeds that the other solves and the one does not.
    """
    flips = gained + lost
    ways = tail = 1
    for heads in range(1, min(gained, lost) + 1):
        ways = ways * (flips - heads + 1) // heads
        tail += ways
    return min(1.0, 2 * tail / 2**flips)


def paired_difference(gained: int, lost: int, episodes: int) -> Interval:
    """Return the 95 % confidence interval of the difference of two rates on the same seeds.

    The adjusted Wald interval of D. G. Bonett and R. M. Price, "Adjusted Wald confidence interval
    for a difference of binomial proportions based on paired data", Journal of Educational and
    Behavioral Statistics 37 (2012).

    Args:
        gained: Seeds that the one solves and the other does not.
        lost: Seeds that the other solves and the one does not.
        episodes: Seeds that both played.
    """
    more, less = (gained + 1) / (episodes + 2), (lost + 1) / (episodes + 2)
    half = Z * sqrt((more + less - (more - less) ** 2) / (episodes + 2))
    return max(more - less - half, -1.0), min(more - less + half, 1.0)


def holm(values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for there being several tests.

    From S. Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal
    of Statistics 6 (1979).
    """
    adjusted, largest = [1.0] * len(values), 0.0
    order = sorted(range(len(values)), key=values.__getitem__)
    for rank, place in enumerate(order):
        largest = max(largest, min(1.0, (len(values) - rank) * values[place]))
        adjusted[place] = largest
    return adjusted
