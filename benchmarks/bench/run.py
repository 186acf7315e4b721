"""``python -m benchmarks bench``: what everything costs, as tables, a record and a plot."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import torch
from rich.console import Console
from tqdm import tqdm

from benchmarks.bench import cameras, environments, vectors
from benchmarks.bench.measurement import BenchmarkError, Measurement, Settings
from benchmarks.bench.report import PICTURE, RECORD, Report, machine, read_report, summary
from benchmarks.records import DOCS
from parity.tables import replace_table, update
from robot_layouts.core.writing import write_whole
from robots import MissingPackageError, RobotRegistry, SimulationError, UnknownNameError
from tasks import get_task_class, list_clones
from tasks.registry import full_name

COMMAND = "python -m benchmarks tables"
DEFAULTS = Settings()
Benchmarks = Mapping[str, Callable[[Settings], Measurement]]

BENCHMARKS: Benchmarks = {
    "step": environments.step,
    "reset": environments.reset,
    "vector": vectors.vectors,
    "varying": environments.varying,
    "looks": environments.looks,
    "pictures": vectors.pictures,
    "cameras": cameras.cameras,
    "camera_rate": cameras.camera_rate,
    "environments": environments.environments,
    "workers": vectors.workers,
    "robots": environments.robots,
    "contacts": environments.contacts,
    "memory": vectors.memory,
    "start": vectors.start,
    "recording": environments.recording,
    "validation": environments.validation,
}
BESIDE_NATIVE: Benchmarks = {
    "step": environments.step_beside_native,
    "reset": environments.reset_beside_native,
    "vector": partial(vectors.vectors, native=True),
    "pictures": partial(vectors.pictures, native=True),
}


def bench(
    settings: Settings = DEFAULTS,
    *,
    only: tuple[str, ...] = (),
    out: Path | None = None,
    native: bool = False,
    record: bool = False,
) -> int:
    """Measure what steps, resets, vectors, recordings and checks of layouts cost, in minutes.

    Args:
        settings: What is measured, and how often.
        only: Benchmarks by name: step, reset, vector, varying, looks, pictures, cameras,
            camera_rate, environments, workers, robots, contacts, memory, start, recording,
            validation (all).
        out: Write bench.json, bench.md and bench.png into this folder.
        native: Measure steps and resets of all clones, vectors and pictures beside native.
        record: Keep it, beside native, in docs/benchmarks.json for the documentation; with --only,
            beside what was recorded before of the others.

    Raises:
        RobotLayoutsError: If an option is invalid, or nothing can be recorded.
    """
    own_tasks = settings.task != DEFAULTS.task
    if record and (own_tasks or not (native or {*only}.isdisjoint(BESIDE_NATIVE) and only)):
        raise BenchmarkError(
            "--record keeps what is measured beside native: give --native, no --task"
        )
    for kind in settings.kinds:
        RobotRegistry.load(kind)
    for name in only:
        if name not in BENCHMARKS:
            raise UnknownNameError("benchmark", name, BENCHMARKS)
    if own_tasks:
        task_ids = tuple(full_name(get_task_class(task)) for task in settings.task)
        settings = replace(settings, task=task_ids, vector_task=task_ids)
    logging.disable(logging.WARNING)
    report = run(only or tuple(BENCHMARKS), settings, native=native)
    if not report.measurements:
        return 1
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, 120)
    report.print(console)
    if out is not None:
        report.write(out)
    if record:
        if report.left_out:
            missing = ", ".join(report.left_out)
            raise BenchmarkError(f"nothing is recorded, as {missing} was left out")
        report = read_report().with_those_of(report, tuple(BENCHMARKS)) if only else report
        write_whole(RECORD, report.as_json())
        report.draw(PICTURE)
        print(f"{RECORD}: recorded; `python -m benchmarks tables` shows it in docs")
    return 0


def run(names: Sequence[str], settings: Settings, *, native: bool = False) -> Report:
    """Run benchmarks one after the other; what cannot be measured here is left out, and said.

    Args:
        names: Which ones.
        settings: How they measure.
        native: Whether to measure beside native, on all clones unless tasks are chosen.
    """
    torch.set_num_threads(1)  # the tensors are small: threads would only wait for each other
    load, found, left_out = [os.getloadavg()[0]], list[Measurement](), dict[str, str]()
    with tqdm(total=len(names), unit="benchmarks", disable=None) as bar:
        for name in names:
            bar.set_description(name)
            chosen = replace(settings, tick=bar.update)
            measure = BENCHMARKS[name]
            if native and name in BESIDE_NATIVE:
                measure = BESIDE_NATIVE[name]
                if name in ("step", "reset") and settings.task == DEFAULTS.task:
                    chosen = replace(chosen, task=list_clones())
            try:
                found.append(measure(chosen))
            except (BenchmarkError, MissingPackageError, SimulationError) as error:
                left_out[name] = str(error)
                bar.write(f"{name} is left out: {error}", sys.stderr)
    load.append(os.getloadavg()[0])
    loads = tuple(round(each, 1) for each in load)
    return Report(tuple(found), machine(), str(settings.clock), loads, left_out)


def tables(*, check: bool = False) -> int:
    """Write the recorded benchmarks into docs/benchmarks.md and docs/parity.md.

    Args:
        check: Write nothing, and exit with 1 if a page is stale.

    Raises:
        RobotLayoutsError: If a record or a page cannot be read or written.
    """
    report, parity = read_report(), DOCS / "parity.md"
    pages = {
        DOCS / "benchmarks.md": report.page(),
        parity: replace_table(parity, "benchmarks", COMMAND, summary(report)),
    }
    return update(pages, COMMAND, check=check)
