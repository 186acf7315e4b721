"""``python -m measurements.teleop``: how long it takes from a drag on the page to its picture.

A process serves the page of ``teleop``, and a chromium without a graphics card shows it. The mouse
drags the gizmos of the arms up and down in turn. The page itself measures, for each move of the
mouse that a step went by, the time to the first picture of that step (`rollouts.teleop.stopwatch`);
this command says what it measured. Times that pass are only comparable on a machine that is quiet.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from measurements.robots.record import versions_of
from measurements.teleop.latency import measure
from robots.common.cli import at_least
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.progress import LiveLine
from rollouts.teleop.stopwatch import MOST

TASK = "TwoRobotPickCube-v1"
ALLOWED = 150.0  # ms, the median


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if half of the drags are seen within 150 ms, else 1.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.teleop", description=__doc__)
    add = parser.add_argument
    add("--task", default=TASK, help="task id (%(default)s)")
    words = f"how many, at most {MOST} (%(default)s)"
    add("--drags", type=at_least(1), default=MOST, metavar="N", help=words)
    add("--picture", type=Path, metavar="FILE", help="save the page as it looks at the end")
    add("--out", type=Path, metavar="FILE", help="write the numbers as json, too")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    with LiveLine(options.drags, "drags") as line:
        seen = measure(options.task, options.drags, options.picture, line.update)
    print(
        f"{options.task}, {len(seen.times)} drags: {seen.median:.0f} ms from drag to picture"
        f" (median), {seen.most:.0f} ms (95 %). {seen.clock} {seen.cores} cores,"
        f" load {seen.load:.1f} before."
    )
    if options.out:
        versions = versions_of("viser", "playwright", "sapien")
        about = {"task": options.task, "median": seen.median, "versions": versions, **asdict(seen)}
        write_whole(options.out, json.dumps(about, indent=1) + "\n")
    return int(seen.median > ALLOWED)


if __name__ == "__main__":
    start(main)
