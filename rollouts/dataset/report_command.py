"""``robot-layouts report``: what a data set holds, on one HTML page."""

from __future__ import annotations

import argparse
from pathlib import Path

from robots.assets.progress import size
from robots.common.commands import printable
from rollouts.playing.command_options import zero_or_more
from tasks.cell_options import add_cell_options, chosen_cell

EPILOG = (
    "The page needs nothing else, and loads nothing. A certificate beside the recording is shown."
    " Exit code: 0 if the page was written, 1 if not, 2 for bad usage."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="the folder of a recording, or one h5 file")
    add("--out", type=Path, required=True, metavar="PAGE", help="the HTML file")
    add(
        "--clearances",
        type=zero_or_more,
        default=100,
        metavar="N",
        help="measure in N episodes how near robots came; needs the extra checks (%(default)s)",
    )
    add(
        "--clips",
        type=zero_or_more,
        default=4,
        metavar="N",
        help="film N episodes; needs Vulkan and the extra video (%(default)s)",
    )
    add("--task", help="the recording's task; MODULE:ID for one of your own")
    add_cell_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If the recording cannot be read, or the page not be written.
    """
    import torch

    from robots import RecordingError
    from robots.common.writing import write_whole
    from rollouts.dataset.page import render
    from rollouts.dataset.report import make_report
    from rollouts.progress import LiveLine

    torch.set_num_threads(1)
    with LiveLine(unit="parts") as line:

        def show(done: float, total: float, what: str) -> None:
            line.total = total
            line.update(done, what)

        report = make_report(
            options.file,
            task_id=options.task,
            cell=chosen_cell(options),
            clearances=options.clearances,
            clips=options.clips,
            progress=show,
        )
    page = render(report)
    write_whole(options.out, page, RecordingError)
    print(printable(f"{options.out}: {size(len(page.encode()))}"))
    for remark in report.remarks:
        print(printable(remark))
    return 0
