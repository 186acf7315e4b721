"""`python -m rollouts export`: a recording becomes a dataset for a training tool."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rollouts.export.dataset import Exported

DESCRIPTION = "write a recording as a dataset: LeRobot v3.0 or robomimic hdf5"
EPILOG = (
    "The dataset appears when it is complete. Exit code: 0 if it was written, 1 if not, 2 for bad"
    " usage."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Tell a parser what the command takes."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("recording", type=Path, metavar="FILE", help="an h5 file, or a recording's folder")
    add("--format", required=True, metavar="FORMAT", help="lerobot or robomimic")
    add("--out", type=Path, required=True, metavar="DIR", help="new folder for the dataset")
    add("--fps", type=int, metavar="N", help="steps per second to state (default: the task's, 20)")
    add("--video", action="store_true", help="draw every step, too (lerobot; needs Vulkan)")
    add("--only-successes", action="store_true", help="leave out episodes that end in failure")
    add("--task", help="the recording's task; MODULE:ID for one of your own")


def run(options: argparse.Namespace) -> int:
    """Run the command.

    Returns:
        0.

    Raises:
        RobotLayoutsError: If the export fails; see `rollouts.export.dataset`.
    """
    from rollouts.export.dataset import Export, export
    from rollouts.progress import LiveLine

    wanted = Export(
        options.recording,
        options.format,
        options.out,
        fps=options.fps,
        video=options.video,
        only_successes=options.only_successes,
        task=options.task,
    )
    with LiveLine(unit="episodes") as line:

        def show(done: float, total: int) -> None:
            line.total = total
            line.update(round(done, 1), f"exporting {options.recording.name}")

        done = export(wanted, show)
    print(_summary(done))
    return 0


def _summary(done: Exported) -> str:
    left_out = f"; {done.left_out} without success left out" if done.left_out else ""
    episodes = "1 episode" if done.episodes == 1 else f"{done.episodes} episodes"
    return f"{done.folder}: {episodes}, {done.steps} steps{left_out}"
