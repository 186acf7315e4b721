"""How costs are measured: with which clock, how often, in which order; and what was measured."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import product
from statistics import median, quantiles
from typing import Any, TypeVar

from robots import RobotLayoutsError

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
MOST_ROBOTS = 8
DIGITS = 5  # significant, of a sample: no clock is better

Key = TypeVar("Key", bound=Hashable)
Value = int | str
SomeValue = TypeVar("SomeValue", int, str)
Sample = Callable[[int], float]
"""Takes one sample, given the number of the round."""


class BenchmarkError(RobotLayoutsError, RuntimeError):
    """Something that cannot be measured here, or a file that holds no measurements."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the benchmarks of a run have in common.

    Attributes:
        task: Task ids; benchmarks that take one task alone take the first.
        vector_task: Task ids of which vectors are measured.
        rounds: Samples of each measurement.
        processor_time: Measure the time that processors spend, which other programs disturb less
            than time that passes.
        steps: Control steps of a sample of one environment.
        batch_steps: Control steps of a sample of many environments.
        environments: Numbers of environments in one process.
        workers: Numbers of worker processes; 0 is this process.
        worker_envs: Environments of each worker.
        robots: Numbers of robots.
        kinds: Robots by name, which take turns in the mixed rings.
        cubes: Numbers of cubes that touch.
        started: Numbers of environments whose start is timed.
        episodes: Episodes of a recording.
        checked: Numbers of robots whose layout is validated.
        tick: Called with the share of a benchmark that was just done.
    """

    task: tuple[str, ...] = ("PickCube-v1", "TwoRobotPickCube-v1", "PushT-v1")
    vector_task: tuple[str, ...] = ("PickCube-v1", "TwoRobotPickCube-v1", "FourRobotStack-v1")
    rounds: int = 12
    processor_time: bool = False
    steps: int = 50
    batch_steps: int = 25
    environments: tuple[int, ...] = (1, 4, 16, 64)
    workers: tuple[int, ...] = (0, *(2**k for k in range(3) if 2**k <= CORES))
    worker_envs: int = 32
    robots: tuple[int, ...] = (1, 2, 4, 8)
    kinds: tuple[str, ...] = ("panda", "so100", "panda_stick")
    cubes: tuple[int, ...] = (0, 8, 16, 32, 64)
    started: tuple[int, ...] = (1, 64)
    episodes: int = 12
    checked: tuple[int, ...] = (1, 2, 4)
    tick: Callable[[float], None] = lambda share: None

    def __post_init__(self) -> None:
        """Refuse numbers that cannot be.

        Raises:
            BenchmarkError: If there are any.
        """
        for name, least, most in (
            *((name, 1, None) for name in ("rounds", "steps", "batch_steps", "environments")),
            ("robots", 1, MOST_ROBOTS),
            ("workers", 0, None),
            ("cubes", 0, None),
        ):
            numbers = getattr(self, name)
            for number in numbers if isinstance(numbers, tuple) else (numbers,):
                if number < least or (most is not None and number > most):
                    bounds = f"{least} or more" if most is None else f"from {least} to {most}"
                    option = name.replace("_", "-")
                    raise BenchmarkError(f"--{option} is {number}; it must be {bounds}")

    @property
    def clock(self) -> Clock:
        """What times are measured with."""
        return Clock(self.processor_time)

    def interleave(
        self,
        variants: Mapping[Key, Sample],
        *,
        part: float = 1.0,
        rounds: int | None = None,
        warm_up: bool = True,
    ) -> dict[Key, list[float]]:
        """Take one sample of each variant, one after the other, again and again.

        What slows the machine down for a while meets all of them.

        Args:
            variants: What takes the samples; it chooses what it times.
            part: Share of the whole benchmark that they are.
            rounds: Samples of each, where not as many as of everything else.
            warm_up: Whether a first round does not count.

        Returns:
            Samples of each variant, by round.
        """
        samples: dict[Key, list[float]] = {key: [] for key in variants}
        numbers = range(0 if warm_up else 1, 1 + (self.rounds if rounds is None else rounds))
        for number, (key, variant) in product(numbers, variants.items()):
            sample = variant(number)
            if number > 0:
                samples[key].append(_rounded(sample))
            self.tick(part / (len(numbers) * len(variants)))
        return samples


@dataclass(frozen=True)
class Clock:
    """Time that passes, or time that processors spend.

    Attributes:
        processor: Whether it is the latter.
    """

    processor: bool = False

    def now(self, others: Iterable[int] = ()) -> float:
        """Return the time (s) since some moment.

        Args:
            others: Processes, by id, whose processor time counts as well as this one's.
        """
        if not self.processor:
            return time.perf_counter()
        # As clock_getcpuclockid(3) composes a process's clock on Linux.
        return time.process_time() + sum(time.clock_gettime(~pid << 3 | 2) for pid in others)

    @property
    def rate_unit(self) -> str:
        """Unit of `rate` where environments are stepped."""
        return "environment steps per second" + " of processor time" * self.processor

    def rate(self, work: Iterable[tuple[float, float]]) -> float:
        """Return how much is done per second by several processes that run at once.

        Args:
            work: What each has done, and the seconds that it took.
        """
        work = list(work)
        if self.processor:
            return sum(done for done, _ in work) / sum(seconds for _, seconds in work)
        return sum(done / seconds for done, seconds in work)

    def __str__(self) -> str:
        """Say which one it is."""
        return "processor time of all processes" if self.processor else "time that went by"


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
        conditions: On what it was measured, and how, if not as all others of a report.
    """

    name: str
    title: str
    unit: str
    variable: str
    values: tuple[Value, ...]
    samples: dict[str, list[list[float]]]
    floors: tuple[str, ...] = ()
    ratios: tuple[tuple[str, str], ...] = ()
    conditions: str = ""

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
            ratios = [self.ratio(*pair, value) for pair in self.ratios]
            yield [
                str(value),
                *(number_text(self.median(series, value)) for series in self.samples),
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
        fields = {name: found[name] for name in Measurement.__dataclass_fields__}
        fields |= {name: tuple(fields[name]) for name in ("values", "floors")}
        fields["ratios"] = tuple((over, under) for over, under in fields["ratios"])
        return Measurement(**fields)

    def _at(self, series: str, value: Value) -> list[float]:
        return self.samples[series][self.values.index(value)]


def measured(
    name: str,
    title: str,
    unit: str,
    variable: str,
    samples: Mapping[tuple[str, SomeValue], list[float]],
    floors: tuple[str, ...] = (),
    ratios: tuple[tuple[str, str], ...] = (),
) -> Measurement:
    """Return a measurement of samples by series and value, in the order in which these come first.

    The other arguments are those of `Measurement`.
    """
    values = tuple(dict.fromkeys(value for _, value in samples))
    by_series = {
        series: [samples.get((series, value), []) for value in values]
        for series in dict.fromkeys(series for series, _ in samples)
    }
    return Measurement(name, title, unit, variable, values, by_series, floors, ratios)


def number_text(number: float | None) -> str:
    """Return a number with about three digits, or a dash."""
    if number is None:
        return "–"
    return f"{number:.{0 if abs(number) >= 100 else 1 if abs(number) >= 10 else 2}f}"


def _rounded(number: Any) -> Any:
    return None if number is None else float(f"{number:.{DIGITS}g}")
