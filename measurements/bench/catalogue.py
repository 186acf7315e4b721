"""Which benchmarks need nothing but this library, and how any are run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch

from measurements.bench import episodes, looks, pictures, processes, steps, varying, vectors
from measurements.bench.measurement import BenchmarkError, Measurement
from measurements.bench.report import Report, machine
from measurements.bench.settings import Benchmark, Settings
from robots import MissingPackageError, SimulationError, UnknownNameError
from rollouts.progress import LiveLine

BENCHMARKS: Mapping[str, Benchmark] = {
    "step": Benchmark("a step of one environment", steps.step),
    "reset": Benchmark("a reset of one environment", episodes.reset),
    "vector": Benchmark("vectors of many environments on two cores", vectors.vectors),
    "varying": Benchmark("resets and steps of worlds that vary", varying.varying),
    "looks": Benchmark("resets and first pictures of worlds that look different", looks.looks),
    "pictures": Benchmark("rate of environments that observe pictures", pictures.pictures),
    "environments": Benchmark("a step by number of environments", steps.environments),
    "workers": Benchmark("rate by number of worker processes", processes.workers),
    "robots": Benchmark("a step by number of robots, of one kind and mixed", steps.robots),
    "contacts": Benchmark("a step by number of bodies that touch", steps.contacts),
    "memory": Benchmark("memory of one more environment", processes.memory),
    "start": Benchmark("start of a vector of environments", processes.start),
    "recording": Benchmark("an episode that is recorded", episodes.recording),
    "validation": Benchmark("layout.validate()", episodes.validation),
}


def expect_known(names: Sequence[str], catalogue: Mapping[str, Benchmark]) -> None:
    """Refuse names of no benchmark.

    Raises:
        UnknownNameError: If there are any.
    """
    for name in names:
        if name not in catalogue:
            raise UnknownNameError("benchmark", name, catalogue)


def measure(
    names: Sequence[str], catalogue: Mapping[str, Benchmark], settings: Settings, line: LiveLine
) -> Report:
    """Run benchmarks one after the other; what cannot be measured here is left out, with a word.

    Args:
        names: Which ones.
        catalogue: Where they are.
        settings: How they measure.
        line: Tells how far it is.
    """
    torch.set_num_threads(1)  # the tensors are small: threads would only wait for each other
    load, found = [_load()], list[Measurement]()
    left_out: dict[str, str] = {}
    for number, name in enumerate(names):
        progress = _Progress(line, number, name)
        try:
            found.append(catalogue[name].measure(replace(settings, tick=progress.tick)))
        except (BenchmarkError, MissingPackageError, SimulationError) as error:
            left_out[name] = str(error)
            line.say(f"{name} is left out: {error}")
    load.append(_load())
    return Report(tuple(found), machine(), str(settings.clock), tuple(load), left_out)


def _load() -> float:
    """Return how many processes wanted a core, on average over a minute."""
    return round(os.getloadavg()[0], 1)


class _Progress:
    """How far one of several benchmarks is."""

    def __init__(self, line: LiveLine, number: int, name: str) -> None:
        self._line, self._number, self._name, self._done = line, number, name, 0.0
        self.tick(0.0)

    def tick(self, share: float) -> None:
        """Note that a share of it was done."""
        self._done += share
        self._line.update(round(self._number + self._done, 1), self._name)
