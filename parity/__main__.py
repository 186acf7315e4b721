"""``python -m parity COMMAND``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from parity.command_line import run_command
from parity.compare import compare
from parity.inventory import inventory
from parity.render import render
from parity.replay import replay
from parity.report import report
from parity.rollout import rollout
from parity.sweep import sweep
from parity.tables import tables

COMMANDS = {
    function.__name__: function
    for function in (compare, replay, rollout, render, sweep, report, inventory, tables)
}


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; see `parity.command_line.run_command`."""
    return run_command("parity", COMMANDS, words)


if __name__ == "__main__":
    sys.exit(main())
