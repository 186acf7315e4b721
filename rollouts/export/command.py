"""`robot-layouts export`: a recording becomes a dataset for a training tool."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from robots.common.pages import plural
from rollouts.playing.command_options import add_arguments as add_executor_arguments
from rollouts.playing.command_options import chosen_executor, picture_size, stop_signals

if TYPE_CHECKING:
    from rollouts.export.dataset import Exported

EPILOG = (
    "The dataset appears when it is complete. Exit code: 0 if it was written, 1 if not, 2 for bad"
    " usage."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Tell a parser what the command takes."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("recording", type=Path, metavar="FILE", help="an h5 file, or a recording's folder")
    add(
        "--format",
        required=True,
        metavar="FORMAT",
        help="format of the dataset: lerobot or robomimic",
    )
    add("--out", type=Path, required=True, metavar="DIR", help="new folder for the dataset")
    add("--fps", type=int, metavar="N", help="steps per second to state (default: the task's, 20)")
    add("--video", action="store_true", help="draw every step as well (lerobot; needs Vulkan)")
    add(
        "--cameras",
        nargs="+",
        metavar="NAME",
        help="draw what these cameras see, as videos (lerobot) or arrays (robomimic): all,"
        " overview, or by place: base_camera, left.hand_camera",
    )
    add(
        "--images",
        action="store_true",
        help="write png images, which lose nothing, in place of videos",
    )
    add("--depth", action="store_true", help="write the cameras' depth as well (mm, 16 bits)")
    add(
        "--size",
        type=picture_size,
        metavar="WxH",
        help="width and height of the pictures in pixels (each camera's own)",
    )
    add("--instruction", metavar="TEXT", help="what the policy is to do, in words (the task's own)")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--include-failures", action="store_true", help="export episodes without success, too"
    )
    which.add_argument("--only-successes", action="store_true", help="what happens anyway")
    add("--task", help="the recording's task; MODULE:ID for one of your own")
    add_executor_arguments(parser)


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
        include_failures=options.include_failures,
        task=options.task,
        cameras=options.cameras,
        images=options.images,
        depth=options.depth,
        size=options.size,
        instruction=options.instruction,
    )
    in_process = options.workers == 0 and options.ray is None
    executor = None if in_process else chosen_executor(options)
    with LiveLine(unit="episodes") as line, stop_signals():

        def show(done: float, total: int) -> None:
            line.total = total
            line.update(round(done, 1), f"exporting {options.recording.name}")

        done = export(wanted, show, executor=executor, tell=line.say)
    print(_summary(done))
    return 0


def _summary(done: Exported) -> str:
    left_out = ""
    if done.left_out:
        failures = plural(done.left_out, "episode")
        left_out = f"; left out: {failures} without success (--include-failures exports them)"
    return f"{done.folder}: {plural(done.episodes, 'episode')}, {done.steps} steps{left_out}"
