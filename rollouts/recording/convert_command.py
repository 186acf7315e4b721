"""``robot-layouts convert``: a recording in another control mode."""

from __future__ import annotations

import argparse
from pathlib import Path

from robots import RecordingError
from robots.common.commands import printable
from rollouts.playing.command_options import add_control_mode
from rollouts.playing.replay_command import add_recording
from tasks.cell_options import chosen_cell

EPILOG = (
    "Each episode is played in its own mode and in the other, and kept if it succeeds there too."
    " Those that did not succeed when they were recorded are left out. Exit code: 0 if all others"
    " were kept, 1 if not, 2 for bad usage."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add_recording(parser)
    add_control_mode(parser, "--to", required=True)
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR", help="folder of trajectory.h5 and .json")
    add("--episodes", type=int, metavar="N", help="convert the first N episodes (all)")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If the recording cannot be played or the other not be written.
    """
    import torch

    from rollouts.playing.replay import open_recording
    from rollouts.progress import LiveLine
    from rollouts.recording.convert import convert

    torch.set_num_threads(1)
    with open_recording(options.file, options.task) as file:
        count = len(file) if options.episodes is None else max(0, min(options.episodes, len(file)))
        if not count:
            raise RecordingError(f"{file.path} has no episodes to convert")
        with LiveLine(count, "episodes") as line:
            summary = convert(
                file,
                options.to,
                options.out,
                count,
                chosen_cell(options),
                lambda: line.advance(1, "converting"),
            )
    print(printable(str(summary)))
    return 0 if summary.complete else 1
