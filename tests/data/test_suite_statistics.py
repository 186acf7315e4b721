"""Intervals and tests of a suite's report, beside SciPy's and beside what they promise."""

from itertools import product
from math import comb

import pytest
from scipy.stats import binomtest

from robot_layouts.data.suite.results import holm, mcnemar, paired_difference, wilson


@pytest.mark.parametrize("episodes", [1, 2, 10, 100])
def test_wilson_is_scipys(episodes):
    for successes in range(episodes + 1):
        other = binomtest(successes, episodes).proportion_ci(0.95, method="wilson")
        assert wilson(successes, episodes) == pytest.approx((other.low, other.high), abs=1e-12)


def test_wilson_of_all_and_none_ends_there():
    """Whatever rounding does: 0 of 3 is 0 %, 3 of 3 is 100 %."""
    for episodes in range(1, 300):
        assert wilson(0, episodes)[0] == 0.0
        assert wilson(episodes, episodes)[1] == 1.0


def test_mcnemar_is_a_fair_coin():
    for gained, lost in product(range(12), range(12)):
        fair = binomtest(gained, gained + lost).pvalue if gained + lost else 1.0
        assert mcnemar(gained, lost) == pytest.approx(fair)


def test_mcnemar_of_many():
    assert mcnemar(1000, 0) == 2 * 0.5**1000
    assert mcnemar(5000, 5000) == 1.0


@pytest.mark.parametrize("more", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("less", [0.02, 0.1, 0.3])
def test_the_interval_of_a_paired_difference_covers_it(more, less):
    """In 95 % of all draws of 50 seeds, each weighted by how probable it is."""
    episodes, covered = 50, 0.0
    for gained in range(episodes + 1):
        for lost in range(episodes + 1 - gained):
            low, high = paired_difference(gained, lost, episodes)
            if low <= more - less <= high:
                rest = episodes - gained - lost
                ways = comb(episodes, gained) * comb(episodes - gained, lost)
                covered += ways * more**gained * less**lost * (1 - more - less) ** rest
    assert covered > 0.94
    assert covered < 0.97 or min(more, less) < 0.1  # of rare events it is too wide


def test_the_interval_turns_with_the_sides():
    low, high = paired_difference(7, 2, 40)
    assert paired_difference(2, 7, 40) == pytest.approx((-high, -low))
    assert paired_difference(1, 0, 1)[1] == 1.0


def test_holm():
    """The smallest of four is taken four times, and none ends up below one before it."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []
