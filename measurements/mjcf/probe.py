"""Tries one MJCF in this process: ``python -m measurements.mjcf.probe MJCF``.

Prints a line of JSON for each thing that it tried, as `measurements.robots.probe` does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from layouts import single
from measurements.mjcf.agreement import largest_difference
from measurements.robots.probe import Seen, loads, tcp_move, tell, trial, valid
from robots import RobotDescriptor


def main() -> int:
    """Try the MJCF of the command line, thing by thing."""
    path = Path(sys.argv[1]).absolute()
    robots: list[RobotDescriptor] = []
    tell("loads", lambda: loads(path, robots))
    for robot in robots:
        tell("kinematics", lambda: {"difference": largest_difference(path)})
        for what, look in LOOKS.items():
            tell(what, partial(look, robot))
    return 0


LOOKS: Mapping[str, Callable[[RobotDescriptor], Seen]] = {
    "alone": lambda robot: valid(single({"robot": robot})),
    "trial": trial,
    "tcp_move": tcp_move,
}


if __name__ == "__main__":
    sys.exit(main())
