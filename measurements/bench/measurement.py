"""What a benchmark measured: samples of several series, taken in turns, and their medians."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from statistics import median, quantiles
from typing import Any, TypeVar

from robots import RobotLayoutsError

Key = TypeVar("Key", bound=Hashable)
Value = int | str
SomeValue = TypeVar("SomeValue", int, str)
DIGITS = 5  # significant, of a sample: no clock is better


class BenchmarkError(RobotLayoutsError, RuntimeError):
    """Something that cannot be measured here, or a file that holds no measurements."""


def interleave(
    variants: Mapping[Key, Callable[[int], float]],
    rounds: int,
    tick: Callable[[float], None] = lambda share: None,
    *,
    warm_up: bool = True,
) -> dict[Key, list[float]]:
    """Take one sample of each variant, one after the other, again and again.

    What slows the machine down for a while meets all of them.

    Args:
        variants: Takes the number of the round and returns a sample; it chooses what it times.
        rounds: Samples of each.
        tick: Called after each sample with the share of the whole that it was.
        warm_up: Whether a first round goes before whose samples do not count.

    Returns:
        Samples of each variant, by round.
    """
    samples: dict[Key, list[float]] = {key: [] for key in variants}
    numbers = range(0 if warm_up else 1, rounds + 1)
    for number, (key, variant) in product(numbers, variants.items()):
        sample = variant(number)
        if number > 0:
            samples[key].append(_rounded(sample))
        tick(1 / (len(numbers) * len(variants)))
    return samples


@dataclass(frozen=True)
class Measurement:
    """Samples of one or more series, at each value of a variable.

    Attributes:
        name: What `--only` calls the benchmark.
        title: What was measured, in words.
        unit: Unit of every sample.
        variable: What differs from one value to the next.
        values: Its values, numbers or names.
        samples: Series → for each value its samples; none where a series has nothing to show.
            Samples of the same place were taken in the same round.
        floors: Series that nothing can beat: the physics alone.
        ratios: Pairs of series whose ratio matters.
    """

    name: str
    title: str
    unit: str
    variable: str
    values: tuple[Value, ...]
    samples: dict[str, list[list[float]]]
    floors: tuple[str, ...] = ()
    ratios: tuple[tuple[str, str], ...] = ()

    def median(self, series: str, value: Value) -> float | None:
        """Return the median of a series at a value; None if there is no sample."""
        samples = self._at(series, value)
        return median(samples) if samples else None

    def quartiles(self, series: str, value: Value) -> tuple[float, float] | None:
        """Return the first and third quartile; None if there are fewer than two samples."""
        samples = self._at(series, value)
        if len(samples) < 2:
            return None
        first, _, third = quantiles(samples, n=4, method="inclusive")
        return first, third

    def ratio(self, over: str, under: str, value: Value) -> float | None:
        """Return the median over rounds of the ratio of two series; None without samples."""
        pairs = list(zip(self._at(over, value), self._at(under, value), strict=False))
        return median(a / b for a, b in pairs) if pairs else None

    def headings(self) -> list[str]:
        """Return the headings of the table, the variable first."""
        return [self.variable, *self.samples, *(f"{a} / {b}" for a, b in self.ratios)]

    def rows(self) -> Iterator[list[str]]:
        """Yield the rows of the table: medians, then medians of ratios, one row per value."""
        for value in self.values:
            medians = [self.median(series, value) for series in self.samples]
            ratios = [self.ratio(*pair, value) for pair in self.ratios]
            yield [
                str(value),
                *(number_text(x) for x in medians),
                *("–" if x is None else f"{x:.2f}" for x in ratios),
            ]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain data, the medians and ratios included."""
        medians = {s: [self.median(s, v) for v in self.values] for s in self.samples}
        ratios = {f"{a} / {b}": [self.ratio(a, b, v) for v in self.values] for a, b in self.ratios}
        return {
            **asdict(self),
            "medians": {name: list(map(_rounded, found)) for name, found in medians.items()},
            "median_ratios": {name: list(map(_rounded, found)) for name, found in ratios.items()},
        }

    @staticmethod
    def from_json(found: Mapping[str, Any]) -> Measurement:
        """Return the measurement that `as_json` wrote.

        Raises:
            KeyError, TypeError: If it is something else.
        """
        return Measurement(
            name=found["name"],
            title=found["title"],
            unit=found["unit"],
            variable=found["variable"],
            values=tuple(found["values"]),
            samples={series: list(at_values) for series, at_values in found["samples"].items()},
            floors=tuple(found["floors"]),
            ratios=tuple((over, under) for over, under in found["ratios"]),
        )

    def _at(self, series: str, value: Value) -> list[float]:
        return self.samples[series][self.values.index(value)]


def by_series(
    values: Sequence[SomeValue], samples: Mapping[tuple[str, SomeValue], list[float]]
) -> dict[str, list[list[float]]]:
    """Sort samples by series, in the order in which the series come first."""
    names = dict.fromkeys(series for series, _ in samples)
    return {series: [samples.get((series, value), []) for value in values] for series in names}


def _rounded(number: Any) -> Any:
    return None if number is None else float(f"{number:.{DIGITS}g}")


def number_text(number: float | None) -> str:
    """Return a number with about three digits, or a dash."""
    if number is None:
        return "–"
    return f"{number:.{0 if abs(number) >= 100 else 1 if abs(number) >= 10 else 2}f}"
