"""``robot-layouts soak``: step every task for long, and see whether anything grows."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from measurements.soak.process_resources import Level
    from measurements.soak.soak import Soaked

EPILOG = (
    "Growth is what the rounds of equal work after the first third add: in the worst of the"
    " workers, and in this process while it makes and closes vectors. Exit code: 0 if nothing"
    " grows, 1 if something does."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("--steps", type=int, default=2_000_000, metavar="N", help="environment steps (%(default)s)")
    add("--tasks", nargs="+", metavar="TASK", help="task ids (all)")
    add("--envs", type=int, default=32, metavar="N", help="environments of a vector (%(default)s)")
    add("--workers", type=int, default=2, metavar="W", help="number of processes (%(default)s)")
    add(
        "--laps",
        type=int,
        default=3,
        metavar="L",
        help="how many times all tasks are stepped (%(default)s)",
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If an argument makes no sense, or a worker is lost.
    """
    from rich.console import Console

    from measurements.soak.soak import Soak, between_laps, complaints, soak
    from rollouts.progress import LiveLine
    from tasks import list_tasks

    task_ids = tuple(options.tasks or list_tasks())
    wanted = Soak(options.steps, task_ids, options.envs, options.workers, options.laps)
    with LiveLine(wanted.planned, "environment steps") as line:
        found = soak(wanted, lambda task_id, steps: line.advance(steps, task_id))
    rest, growing = between_laps(found), complaints(found)
    steps, seconds = sum(x.steps for x in found), sum(x.seconds for x in found)
    console = Console(highlight=False, soft_wrap=True)
    console.print(table(found))
    console.print(
        f"This process, from lap to lap: {rest.memory:+.2f} MB, all else {_counted(rest)}."
    )
    for complaint in growing:
        console.print(f"GROWS: {complaint}")
    console.print(
        f"{steps:,} environment steps in {seconds:.0f} s:"
        f" {'something' if growing else 'nothing'} grows."
    )
    return 1 if growing else 0


def table(found: Sequence[Soaked]) -> Table:
    """Return what was seen of each task, a row each."""
    from rich import box
    from rich.table import Table

    from measurements.soak.process_resources import worst

    rows = Table(box=box.SIMPLE_HEAD)
    rows.add_column("task", no_wrap=True)
    for name in ("steps", "steps/s", "worker\nMB", "growth\nMB", "here\ngrowth"):
        rows.add_column(name, justify="right", no_wrap=True)
    rows.add_column("all else")
    for task in found:
        worker, here = task.in_workers, task.in_process
        rows.add_row(
            task.task_id,
            f"{task.steps:,}",
            f"{task.steps / task.seconds:,.0f}",
            f"{max(levels[-1].memory for levels in task.workers):.0f}",
            f"{worker.memory:+.2f}",
            f"{here.memory:+.2f}",
            _counted(worst((worker, here))),
        )
    return rows


def _counted(level: Level) -> str:
    from measurements.soak.process_resources import QUANTITIES

    grown = {name: getattr(level, name) for name in QUANTITIES if name != "memory"}
    growth = [f"{name} {value:+.1f}" for name, value in grown.items() if value]
    return ", ".join(growth) or "–"
