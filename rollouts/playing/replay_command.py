"""``robot-layouts replay``: recorded actions are played again."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robots.common.commands import printable
from tasks.cell_options import add_cell_options, chosen_cell

if TYPE_CHECKING:
    from rich.table import Table

    from rollouts.playing.replay import Replayed

EPILOG = (
    "Exit code: 0 if every episode ends as recorded, 1 if not, or if a file cannot be played."
    " Episodes whose reset rebuilt the world must also have the recorded states to the last bit;"
    " those of reused worlds, and all that begin from a state, need not."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add_recording(parser)
    add("--episodes", type=int, metavar="N", help="play the first N episodes (all)")
    add(
        "--from",
        dest="start",
        choices=("seed", "state"),
        default="seed",
        help="begin by a reset with the recorded seed, or, not exactly, from the recorded state",
    )


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which recording; see `rollouts.playing.replay.open_recording`."""
    add = parser.add_argument
    add(
        "file",
        type=Path,
        nargs="?",
        metavar="FILE",
        help="an h5 file, or the folder of a recording, with all its files",
    )
    add(
        "--task",
        help="its task, MODULE:ID for one of your own; without FILE, find its official one in"
        " $MS_ASSET_DIR/demos",
    )
    add_cell_options(parser, varying=False)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If the recording cannot be played.
    """
    import torch
    from rich.console import Console

    from rollouts.playing.replay import open_recording, replay, task_for
    from rollouts.progress import LiveLine

    torch.set_num_threads(1)
    with open_recording(options.file, options.task) as file:
        task = task_for(file, **chosen_cell(options))
        count = len(file) if options.episodes is None else max(0, min(options.episodes, len(file)))
        found: list[Replayed] = []
        with LiveLine(count, "episodes") as line:
            for number in range(count):
                found.append(replay(task, file[number], options.start))
                line.advance(1, "replaying")
        console = Console(markup=False, highlight=False)
        console.print(
            printable(f"{file.path}: {file.task_id}, {file.control_mode}"), soft_wrap=True
        )
    console.print(_table(found))
    for sentence in _sentences(found, options.start):
        console.print(sentence, soft_wrap=True)
    return 0 if found and all(episode.agrees for episode in found) else 1


def _table(found: Sequence[Replayed]) -> Table:
    from rich import box
    from rich.table import Table

    rows = Table(box=box.SIMPLE_HEAD)
    for name in ("episode", "seed", "steps"):
        rows.add_column(name, justify="right")
    for name in ("recorded", "here", "states"):
        rows.add_column(name)
    for episode in found:
        rows.add_row(
            str(episode.episode_id),
            "–" if episode.seed is None else str(episode.seed),
            str(episode.steps),
            _word(episode.recorded),
            _word(episode.success),
            _states(episode),
        )
    return rows


def _sentences(found: Sequence[Replayed], start: str) -> list[str]:
    same = sum(episode.recorded == episode.success for episode in found)
    equal = sum(episode.compared and episode.difference is None for episode in found)
    lines = [
        f"{same} of {len(found)} episodes end as recorded; in {equal} all states are equal to the"
        " last bit."
    ]
    if other := [str(episode.episode_id) for episode in found if not episode.varied_alike]:
        lines.append(f"Their worlds do not vary here as recorded: episodes {', '.join(other)}.")
    if start == "state":
        lines.append("From a state no replay is exact: PhysX's memory is not part of a state.")
    elif any(episode.difference and not episode.exact for episode in found):
        lines.append(
            "Worlds that were reused when an episode was recorded make its states depend on the"
            " episodes before; here every episode has a new world."
        )
    return lines


def _states(episode: Replayed) -> str:
    if not episode.compared:
        return "not recorded"
    return "equal" if episode.difference is None else f"differ {printable(str(episode.difference))}"


def _word(success: bool | None) -> str:
    return {True: "success", False: "failure", None: "–"}[success]
