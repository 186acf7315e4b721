"""What the runs of a suite amount to: rates with intervals, and paired comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from statistics import mean, median

from rollouts.receipts.receipt import EpisodeReceipt, Receipt
from rollouts.suite.statistics import Interval, holm, mcnemar, paired_difference, wilson

Episodes = Sequence[EpisodeReceipt]


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
    """

    successes: int
    episodes: int
    interval: Interval
    length: float
    lengths: tuple[int, int]
    total: float

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
        interval: 95 % confidence interval of the difference of their rates.
        p: Of McNemar's exact test.
        adjusted: The same, by Holm's procedure for all cases; of all cases together, as it is.
    """

    gained: int
    lost: int
    episodes: int
    interval: Interval
    p: float
    adjusted: float

    @property
    def difference(self) -> float:
        """Its success rate minus the other's."""
        return (self.gained - self.lost) / self.episodes


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
    )


def overall(receipts: Sequence[Receipt]) -> Result | None:
    """Return how the episodes of all cases went; None if there are none.

    The interval takes them as draws from all cases alike. As each case has a fixed number of them,
    it is rather too wide than too narrow.
    """
    episodes = list(chain.from_iterable(one.episodes for one in receipts))
    return result_of(episodes) if episodes else None


def compare(pairs: Sequence[tuple[Receipt, Receipt]]) -> list[Comparison]:
    """Return how the first of each pair did beside the second, and last all of them together.

    Args:
        pairs: Receipts of one case, each played with the same seeds.
    """
    counts = [_counts(*pair) for pair in pairs]
    adjusted = holm([mcnemar(gained, lost) for gained, lost, _ in counts])
    found = [_comparison(*of, p) for of, p in zip(counts, adjusted, strict=True)]
    gained, lost, episodes = (sum(column) for column in zip(*counts, strict=True))
    return [*found, _comparison(gained, lost, episodes, mcnemar(gained, lost))]


def _counts(one: Receipt, other: Receipt) -> tuple[int, int, int]:
    solved = {episode.seed: episode.success for episode in other.episodes}
    both = [(e.success, solved[e.seed]) for e in one.episodes if e.seed in solved]
    return both.count((True, False)), both.count((False, True)), len(both)


def _comparison(gained: int, lost: int, episodes: int, adjusted: float) -> Comparison:
    interval = paired_difference(gained, lost, episodes)
    return Comparison(gained, lost, episodes, interval, mcnemar(gained, lost), adjusted)
