"""What is drawn: every distribution by its statistics, every stream by what it depends on."""

import json
import pickle
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import TaskError, UnknownNameError
from tasks import Choice, Fixed, LogUniform, Normal, Uniform, Whole
from tasks.randomization.distributions import Distribution, Stream, read_distribution

ALL = (
    Fixed(2.0),
    Uniform(-1.0, 3.0),
    LogUniform(0.25, 4.0),
    Whole(-1, 2),
    Normal(0.5, 1.0),
    Normal(1.0, 0.0, low=-0.5, high=2.0),
    Normal(0.0, 1.0),
    Choice((0.1, 0.5, 0.7)),
)
DRAWS = Stream(7).numbers(20_000, "test")


def drawn(distribution: Distribution) -> list[float]:
    return [distribution.value(u) for u in DRAWS]


@pytest.mark.parametrize("distribution", ALL, ids=str)
def test_it_stays_within_its_bounds(distribution: Distribution) -> None:
    low, high = distribution.bounds
    ends = (2.0**-54, 1 - 2.0**-53)
    values = [*drawn(distribution), *map(distribution.value, ends)]
    assert all(low <= value <= high for value in values)


@pytest.mark.parametrize("distribution", ALL, ids=str)
def test_it_goes_through_json_and_pickle(distribution: Distribution) -> None:
    text = json.dumps(distribution.to_json())
    assert read_distribution(json.loads(text), "it") == distribution
    assert pickle.loads(pickle.dumps(distribution)) == distribution


@pytest.mark.parametrize(
    ("distribution", "mean", "std"),
    [
        (Uniform(-1.0, 3.0), 1.0, 4 / 12**0.5),
        (LogUniform(0.25, 4.0), 1.3525, 1.0221),
        (Whole(-1, 2), 0.5, 1.25**0.5),
        (Normal(0.5, 1.0), 1.0, 0.5),
        (Normal(1.0, 0.0, low=0.0), (2 / 3.14159265) ** 0.5, (1 - 2 / 3.14159265) ** 0.5),
        (Choice((1.0, 2.0)), 1.5, 0.5),
    ],
    ids=str,
)
def test_mean_and_deviation_are_those_of_the_distribution(
    distribution: Distribution, mean: float, std: float
) -> None:
    values = drawn(distribution)
    assert statistics.fmean(values) == pytest.approx(mean, abs=4 * std / len(values) ** 0.5)
    assert statistics.pstdev(values) == pytest.approx(std, rel=0.02)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Uniform(2, 1), r"bounds the wrong way round.*Uniform\(1, 2\)"),
        (lambda: Uniform(float("nan"), 1), "Uniform: low is nan"),
        (lambda: LogUniform(0, 1), "must be above 0"),
        (lambda: Whole(0.5, 1), "Whole: low is 0.5; it must be an integer"),
        (lambda: Normal(-0.1), "Normal: std is -0.1"),
        (lambda: Normal(0.1, 0.0, low=5), "next to nothing"),
        (lambda: Normal(0.1, low=1, high=0), "the smaller comes first"),
        (lambda: Normal(0.0, 1.0, high=0.5), "next to nothing"),
        (lambda: Choice(()), "nothing to choose from"),
        (lambda: read_distribution({"choice": "ab"}, "mass"), "choice is 'ab'"),
        (lambda: read_distribution({"uniform": 3}, "mass"), r"it takes \[low, high\]"),
        (lambda: read_distribution({"normal": {"mean": 3}}, "mass"), "lacks its standard"),
        (lambda: read_distribution([1, 2], "mass"), "a distribution is needed"),
    ],
)
def test_what_makes_no_sense_is_refused(make: object, message: str) -> None:
    with pytest.raises(TaskError, match=message):
        make()  # type: ignore[operator]


def test_the_closest_distribution_is_named() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'uniform'"):
        read_distribution({"unifrom": [0, 1]}, "mass of 'cube'")


@given(st.integers(0, 2**32), st.integers(0, 5), st.text(max_size=5))
def test_numbers_follow_from_what_they_are_for(seed: int, resets: int, name: str) -> None:
    number = Stream(seed, resets).number("mass", name)
    assert 0 < number < 1
    assert number == Stream(seed, resets).number("mass", name)
    others = (
        Stream(seed + 1, resets).number("mass", name),
        Stream(seed, resets + 1).number("mass", name),
        Stream(seed, resets).number("friction", name),
        Stream(seed, resets).number("mass", name + "x"),
    )
    assert number not in others


def test_the_first_numbers_do_not_depend_on_how_many_are_drawn() -> None:
    assert Stream(3).numbers(50, "noise")[:7] == Stream(3).numbers(7, "noise")


def test_the_words_are_the_same_everywhere() -> None:
    assert Stream(0).number("mass", "cube") == WORD


WORD = 0.6472003892295695
