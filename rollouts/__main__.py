"""`python -m rollouts COMMAND`: let experts play tasks, record and replay that, judge policies."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from robots.common.commands import exit_code, program, start
from tasks.cell_options import add_cell_options, chosen_cell

# Command -> its module, with DESCRIPTION, add_arguments(parser) and run(options).
COMMANDS = {
    "record": "rollouts.recording.record_command",
    "teleop": "rollouts.teleop.command",
    "evaluate": "rollouts.evaluate_command",
    "verify": "rollouts.receipts.verify_command",
    "suite": "rollouts.suite.command",
    "convert": "rollouts.recording.convert_command",
    "replay": "rollouts.playing.replay_command",
    "certify": "rollouts.dataset.certify_command",
    "report": "rollouts.dataset.report_command",
    "export": "rollouts.export.command",
    "view": "rollouts.view_command",
    "bench": "measurements.bench.command",
    "soak": "measurements.soak.command",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Words after ``python -m rollouts``; by default those of this process.

    Returns:
        0 if all went well, 1 if not, 2 if the command makes no sense.
    """
    options = _parser().parse_args(arguments)
    return exit_code(lambda: options.run(options))


def _demo(options: argparse.Namespace) -> int:
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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=program("rollouts"), description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    demo = commands.add_parser("demo", help="let an expert play a task, ten seeds by default")
    add = demo.add_argument
    add("--task", default="TwoRobotPickCube-v1", help="task id (default %(default)s)")
    add("--seeds", type=_count, default=10, metavar="N", help="play seeds 0 to N - 1 (default 10)")
    add("--out", type=Path, default=Path("runs/demo"), metavar="DIR", help="default %(default)s")
    add("--no-video", action="store_true", help="make no video")
    add_cell_options(demo)
    demo.set_defaults(run=_demo)
    for name, path in COMMANDS.items():
        module = import_module(path)
        command = commands.add_parser(name, help=module.DESCRIPTION, description=module.DESCRIPTION)
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"{count} is not a number of seeds; it must be 1 or more")
    return count


if __name__ == "__main__":
    start(main)
