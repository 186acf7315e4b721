"""What counts of successes tell: intervals of a rate, and whether two policies differ by more."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import NormalDist

LEVEL = 0.95  # of all intervals
Z = NormalDist().inv_cdf((1 + LEVEL) / 2)

Interval = tuple[float, float]
"""Its lower and upper end."""


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
