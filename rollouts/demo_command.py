"""``robot-layouts demo``: an expert plays a task, ten seeds by default."""

from __future__ import annotations

import argparse
from pathlib import Path

from rollouts.playing.command_options import one_or_more
from tasks.cell_options import add_cell_options, chosen_cell


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("--task", default="TwoRobotPickCube-v1", help="id of the task (%(default)s)")
    add("--seeds", type=one_or_more, default=10, metavar="N", help="play seeds 0 to N - 1 (10)")
    add(
        "--out",
        type=Path,
        default=Path("runs/demo"),
        metavar="DIR",
        help="folder of the results (%(default)s)",
    )
    add("--no-video", action="store_true", help="make no video")
    add_cell_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns 0 if every seed was solved, else 1.

    Raises:
        RobotLayoutsError: If the task cannot be made, or has no expert.
    """
    from rich.console import Console

    from rollouts.demo import DemoOptions, run_demo

    chosen = DemoOptions(
        options.task,
        options.seeds,
        options.out,
        video=not options.no_video,
        making=chosen_cell(options),
    )
    return 0 if run_demo(chosen, Console()) else 1
