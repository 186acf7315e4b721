"""``robot-layouts robots list``: a row for every robot that has a name."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from robots.common.commands import print_error
from robots.registry import RobotRegistry


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command lists all robots."""


def run(options: argparse.Namespace) -> int:
    """Print the table; returns 0, or 1 if a robot of another package cannot be loaded."""
    robots, failures = RobotRegistry.load_all()
    rows = [("robot", "joints", "action", "reach (m)", "numbers from")]
    rows += [(r.name, str(r.dof), str(r.action_dim), f"{r.reach:g}", r.source) for r in robots]
    print("\n".join(table(rows)))
    for failure in failures:
        print_error(failure)
    return 1 if failures else 0


def table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield a line for each row, with columns of equal width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()
