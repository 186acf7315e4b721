"""``python -m measurements.motion``: benchmarks of planning motions and of collision checks."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from measurements.motion import checks, queries
from robots.common.commands import exit_code, start

BENCHMARKS = {"queries": queries, "checks": checks}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0, or 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.motion", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, benchmark in BENCHMARKS.items():
        benchmark.add_arguments(commands.add_parser(name, description=benchmark.__doc__))
    options = parser.parse_args(arguments)
    return exit_code(lambda: BENCHMARKS[options.command].run(options))


if __name__ == "__main__":
    start(main)
