"""``python -m benchmarks COMMAND``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks.bench.run import bench, tables
from benchmarks.collisions import collisions
from benchmarks.conversions import conversions
from benchmarks.experts import experts
from benchmarks.gallery.pages import gallery
from benchmarks.learned import imitation, reinforcement
from benchmarks.placing import placing
from benchmarks.planning import planning
from benchmarks.processors import processors
from benchmarks.robots.survey import mjcfs, robots
from benchmarks.site.pictures import pictures
from benchmarks.soak import soak
from benchmarks.teleop import teleop
from parity.command_line import run_command

COMMANDS = {
    function.__name__: function
    for function in (
        bench,
        tables,
        gallery,
        pictures,
        soak,
        robots,
        mjcfs,
        collisions,
        planning,
        placing,
        experts,
        conversions,
        processors,
        imitation,
        reinforcement,
        teleop,
    )
}


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; see `parity.command_line.run_command`."""
    return run_command("benchmarks", COMMANDS, words)


if __name__ == "__main__":
    sys.exit(main())
