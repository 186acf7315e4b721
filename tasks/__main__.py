"""``robot-layouts tasks``: lists tasks, describes one, or shows it on a page."""

from __future__ import annotations

import argparse

from rich.console import Console

from layouts.view_command import add_page_options, page_words, show
from robots import RobotLayoutsError, TaskError
from robots.common.commands import print_error, start
from robots.common.console import add_command, main_of
from robots.common.console import main as run_command
from robots.common.progress import Progress
from tasks.cell_options import add_cell_options, chosen_cell
from tasks.description import (
    TaskFacts,
    declared_facts,
    describe,
    list_table,
    parity_verdicts,
    recorded_sizes,
)
from tasks.registry import list_tasks, load_tasks, make
from tasks.view import task_cell

MIN_WIDTH = 140  # columns that a table may take; a narrower terminal wraps it
TASK_HELP = "task id or another of its names; MODULE:ID for one of your own"
LEGEND = (
    "norm is normalized_dense; the first reward mode is the default. parity: the last recorded"
    " comparison with native ManiSkill, where there was one; obs is the size recorded there."
    " `describe TASK` counts the observation of any task, which takes its robots' files."
)


def _list(options: argparse.Namespace) -> int:
    verdicts, sizes = parity_verdicts(), recorded_sizes()
    for name in options.modules:
        load_tasks(name)
    rows: list[TaskFacts] = []
    failures: list[RobotLayoutsError] = []
    for task_id in list_tasks():
        try:
            rows.append(declared_facts(task_id, sizes.get(task_id)))
        except TaskError as error:  # of another package
            failures.append(error)
    console = _console()
    console.print(list_table(rows, verdicts))
    console.print(LEGEND)
    for failure in failures:
        print_error(failure)
    return 1 if failures else 0


def _describe(options: argparse.Namespace) -> None:
    env = make(options.task, **chosen_cell(options))
    console = _console()
    for part in describe(env):
        console.print(part, soft_wrap=isinstance(part, str))
    env.close()


def _view(options: argparse.Namespace) -> int:
    """Show a task as it is reset, or hand a recording over to the room that reads recordings."""
    if options.demo is not None:
        if cell := chosen_cell(options):
            raise TaskError(
                f"--demo takes no --{' and no --'.join(cell)}: the recording says who stands where"
            )
        words = ["view", options.demo, "--task", options.task, "--episode", str(options.episode)]
        return run_command([*words, *page_words(options)])
    env = make(options.task, obs_mode="none", **chosen_cell(options))
    env.reset(options.seed)
    status = show(lambda: task_cell(env, f"{env.task_id}, seed {options.seed}"), options)
    env.close()
    return status


def _preview(options: argparse.Namespace) -> None:
    """Save one picture of several draws of a task."""
    from tasks.preview import draws, expect_format, save

    target = expect_format(options.out)
    env = make(options.task, obs_mode="none", render_mode="rgb_array", **chosen_cell(options))
    so_far = Progress(work=f"preview of {env.task_id}")
    picture = draws(
        env,
        options.draws,
        seed=options.seed,
        camera=options.camera,
        progress=lambda done: so_far.tell(f"draw {done} of {options.draws}"),
    )
    env.close()
    print(f"picture: {save(picture, target)}")


def _console() -> Console:
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, MIN_WIDTH)
    return console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    every = add_command(commands, "list", "print every task as a row of a table")
    every.add_argument(
        "modules",
        nargs="*",
        metavar="MODULE",
        help="module whose tasks are listed as well, such as mylab.tray",
    )
    every.set_defaults(call=_list)
    one = add_command(commands, "describe", "print everything about a task")
    one.add_argument("task", metavar="TASK", help=TASK_HELP)
    add_cell_options(one)
    one.set_defaults(call=_describe)
    view = add_command(
        commands,
        "view",
        "look at a task, or at a demonstration of it, in a browser",
        epilog="With --demo, it is the same as `robot-layouts view`.",
    )
    view.add_argument("task", metavar="TASK", help=TASK_HELP)
    view.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the reset (0)")
    view.add_argument("--demo", metavar="FILE", help="show this recording (.h5) instead")
    view.add_argument(
        "--episode",
        type=int,
        default=0,
        metavar="N",
        help="which episode of the recording, from 0 (0)",
    )
    add_cell_options(view)
    add_page_options(view)
    view.set_defaults(call=_view)
    preview = add_command(commands, "preview", "save one picture of several draws of a task")
    preview.add_argument("task", metavar="TASK", help=TASK_HELP)
    preview.add_argument(
        "--out",
        default="preview.png",
        metavar="FILE",
        help="the picture: .png, .jpg or .webp (preview.png)",
    )
    preview.add_argument(
        "--draws", type=int, default=12, metavar="N", help="how many resets to draw (12)"
    )
    preview.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the first reset (0)"
    )
    preview.add_argument(
        "--camera",
        metavar="NAME",
        help="camera to draw from, such as base_camera or left.hand_camera (the first one that"
        " varies, or the view that people see)",
    )
    add_cell_options(preview)
    preview.set_defaults(call=_preview)


def run(options: argparse.Namespace) -> int | None:
    """Run the command that is chosen; returns its exit code, None for 0.

    Raises:
        RobotLayoutsError: If it makes no sense, or fails.
    """
    return options.call(options)


main = main_of("tasks")

if __name__ == "__main__":
    start(main)
