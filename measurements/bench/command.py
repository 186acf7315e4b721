"""``robot-layouts bench``: what everything costs, as tables, json and a plot."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from robots import MissingPackageError
from robots.common.cli import at_least
from rollouts.playing.command_options import INTERRUPTED, stop_signals
from tasks.cell_options import Cell
from tasks.language.needs import ACT, HOLD

if TYPE_CHECKING:
    from measurements.bench.report import Report
    from measurements.bench.settings import Benchmark, Settings

EPILOG = (
    "Benchmarks: step, reset, vector, varying, looks, pictures, environments, workers, robots,"
    " contacts, memory, start, recording, validation. One after the other, they take some minutes."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("--only", nargs="+", metavar="NAME", help="these benchmarks; all if left out")
    add("--out", type=Path, metavar="DIR", help="write bench.json, bench.md and bench.png there")
    add("--task", nargs="+", metavar="TASK", help="task ids; what takes one takes the first")
    add("--rounds", type=at_least(1), metavar="N", help="samples of each measurement (12)")
    add(
        "--processor-time",
        action="store_true",
        help="measure processor time, on a machine that does other things as well",
    )
    add("--layout", metavar="FILE", help="stand the robots as in this layout (.yaml)")
    words = "what robots without a place in the task do (without this, they are refused)"
    add("--bystanders", choices=(HOLD, ACT), help=words)
    add("--randomization", metavar="FILE", help="a tasks.Randomization in YAML or json")
    add(
        "--robots",
        type=_number_or_robot,
        nargs="+",
        metavar="N",
        help="numbers of robots, up to 8 (1 2 4 8); PLACE=ROBOT: other robots in places of --task",
    )
    for name, values, about in (
        ("environments", "1 4 16 64", "numbers of environments in one process"),
        ("workers", "0 1 2 4", "numbers of worker processes, as many as there are cores"),
        ("cubes", "0 8 16 32 64", "numbers of cubes that touch"),
    ):
        help_text = f"{about} ({values})"
        add(f"--{name}", type=at_least(0), nargs="+", metavar="N", help=help_text)
    add("--kinds", nargs="+", metavar="ROBOT", help="robots, in turn (panda so100 panda_stick)")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code, 1 if nothing could be measured, 130 if interrupted.

    Raises:
        RobotLayoutsError: If it makes no sense.
    """
    from measurements.bench.catalogue import BENCHMARKS

    status, _ = run_benchmarks(options, BENCHMARKS, settings_of(options))
    return status


def run_benchmarks(
    options: argparse.Namespace, catalogue: Mapping[str, Benchmark], settings: Settings
) -> tuple[int, Report | None]:
    """Run the benchmarks of a catalogue that the command line asks for, and tell what they found.

    Returns:
        Exit code, and the report if anything could be measured.

    Raises:
        RobotLayoutsError: If one asks for what there is not.
    """
    from rich.console import Console

    from measurements.bench.catalogue import expect_known, measure
    from rollouts.progress import LiveLine

    names = list(dict.fromkeys(options.only or catalogue))
    expect_known(names, catalogue)
    try:
        with stop_signals(), LiveLine(len(names), "benchmarks") as line:
            report = measure(names, catalogue, settings, line)
    except KeyboardInterrupt:
        print("stopped; nothing is kept", file=sys.stderr)
        return INTERRUPTED, None
    if not report.measurements:
        return 1, None
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, 120)
    report.print(console)
    if options.out is not None:
        try:
            for path in report.write(options.out):
                print(path)
        except MissingPackageError as error:
            print(f"{options.out}: no plot; {error}")
    return 0, report


def _number_or_robot(text: str) -> int | str:
    return text if "=" in text else at_least(0)(text)


def settings_of(options: argparse.Namespace) -> Settings:
    """Return the settings that a command line asks for.

    Raises:
        UnknownNameError: If it names no task, or no robot.
        BenchmarkError: If a number is too large or too small.
    """
    from measurements.bench.measurement import BenchmarkError
    from measurements.bench.settings import Clock, Settings
    from measurements.bench.worlds import MOST_ROBOTS
    from robots import RobotRegistry
    from tasks import get_task_class
    from tasks.registry import full_name

    for kind in options.kinds or ():
        RobotRegistry.load(kind)
    words = [word for word in options.robots or () if isinstance(word, str)]
    options.robots = [word for word in options.robots or () if not isinstance(word, str)]
    making = Cell(
        layout=options.layout,
        robots=words,
        bystanders=options.bystanders,
        randomization=options.randomization,
    ).making()
    if making and not options.task:
        raise BenchmarkError(f"--{' and --'.join(making)}: of which task? Name it with --task")
    for name, least in (("environments", 1), ("robots", 1)):
        if wrong := [n for n in getattr(options, name) or () if n < least]:
            raise BenchmarkError(f"--{name} {wrong[0]}: it takes numbers of {least} or more")
    if wrong := [n for n in options.robots or () if n > MOST_ROBOTS]:
        raise BenchmarkError(f"--robots {wrong[0]}: it takes numbers from 1 to {MOST_ROBOTS}")
    task_ids = tuple(full_name(get_task_class(task)) for task in options.task or ())
    given = {
        "tasks": task_ids,
        "vector_tasks": task_ids,
        "making": making,
        "rounds": options.rounds,
        **{
            name: tuple(sorted(getattr(options, name) or ()))
            for name in ("environments", "workers", "robots", "cubes")
        },
        "kinds": tuple(options.kinds or ()),
    }
    settings = Settings(clock=Clock(options.processor_time))
    return replace(settings, **{name: value for name, value in given.items() if value})
