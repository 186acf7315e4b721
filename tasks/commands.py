"""``robot-layouts tasks``: lists tasks, describes one, or shows or draws it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Annotated

from rich.console import Console

from layouts.commands import Page
from robot_layouts.core.cli import File, Word
from robot_layouts.core.commands import print_error
from robot_layouts.core.progress import Progress
from robots import RobotLayoutsError, TaskError
from tasks.cell_options import CellOptions
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

FORMATS = ("mjcf", "usd", "ros2")
MIN_WIDTH = 156  # columns that a table may take; a narrower terminal wraps it
LEGEND = (
    "norm is normalized_dense; the first reward mode is the default. parity: the last recorded"
    " comparison with native ManiSkill, where there was one; obs is the size recorded there."
    " `describe TASK` counts the observation of any task, which takes its robots' files."
)


def print_list(modules: Sequence[Annotated[str, Word("MODULE")]] = ()) -> int:
    """Print every task as a row of a table.

    Args:
        modules: Module whose tasks are listed as well, such as mylab.tray.

    Raises:
        RobotLayoutsError: If there is no such module.
    """
    verdicts, sizes = parity_verdicts(), recorded_sizes()
    for name in modules:
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


def print_description(task: str, *, cell: CellOptions) -> None:
    """Print everything about a task.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        cell: Its robots, and what varies.

    Raises:
        RobotLayoutsError: If the task cannot be made.
    """
    env = make(task, **cell.making())
    console = _console()
    for part in describe(env):
        console.print(part, soft_wrap=isinstance(part, str))
    env.close()


def view(task: str, *, seed: int = 0, cell: CellOptions, page: Page) -> None:
    """Look at a task in a browser.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        seed: Seed of the reset.
        cell: Its robots, and what varies.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If the task cannot be made, served or saved.
    """
    env = make(task, obs_mode="none", **cell.making())
    env.reset(seed)
    page.show(lambda: task_cell(env, f"{env.task_id}, seed {seed}"))
    env.close()


def preview(
    task: str,
    *,
    out: File = "preview.png",
    draws: int = 12,
    seed: int = 0,
    camera: Annotated[str, Word("NAME")] | None = None,
    cell: CellOptions,
) -> None:
    """Save one picture of several draws of a task.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        out: The picture: .png, .jpg or .webp.
        draws: How many resets to draw.
        seed: Seed of the first reset.
        camera: Camera to draw from, such as base_camera or left.hand_camera (the first one that
            varies, or the view that people see).
        cell: Its robots, and what varies.

    Raises:
        RobotLayoutsError: If the task cannot be made or drawn.
    """
    from tasks import preview as pictures

    target = pictures.expect_format(out)
    env = make(task, obs_mode="none", render_mode="rgb_array", **cell.making())
    so_far = Progress(work=f"preview of {env.task_id}")
    picture = pictures.draws(
        env,
        draws,
        seed=seed,
        camera=camera,
        progress=lambda done: so_far.tell(f"draw {done} of {draws}"),
    )
    env.close()
    print(f"picture: {pictures.save(picture, target)}")


def export(
    task: str,
    *,
    out: Annotated[str, Word("PATH")],
    format: Annotated[str, Word(choices=FORMATS)] = "mjcf",
    seed: int = 0,
    cell: CellOptions,
) -> None:
    """Write a task's world, as an episode begins, for other programs.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        out: A model for MuJoCo (.xml; meshes go into a folder beside it), a USD stage (.usd, .usda,
            .usdc), or the folder of a ROS 2 package.
        format: What to write.
        seed: Which episode.
        cell: Its robots, and what varies.

    Raises:
        RobotLayoutsError: If the task cannot be made, or cannot be written.
    """
    with closing(make(task, **cell.making())) as env:
        env.reset(seed)
        print(f"{format}: {getattr(env, f'to_{format}')(out)}")


def _console() -> Console:
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, MIN_WIDTH)
    return console
