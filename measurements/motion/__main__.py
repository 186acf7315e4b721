"""``python -m measurements.motion``: benchmarks of planning motions."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from measurements.motion import queries
from robots.common.commands import exit_code, program, start


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0, or 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog=program("measurements.motion"), description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    asked = commands.add_parser("queries", description=queries.__doc__)
    queries.add_arguments(asked)
    options = parser.parse_args(arguments)
    return exit_code(lambda: queries.run(options))


if __name__ == "__main__":
    start(main)
