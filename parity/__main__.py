"""``python -m parity COMMAND``."""

from __future__ import annotations

from parity.compare import compare
from parity.inventory import inventory
from parity.render import render
from parity.replay import replay
from parity.report import report
from parity.rollout import rollout
from parity.sweep import sweep
from parity.tables import tables
from robot_layouts.core.cli import Command, Program
from robot_layouts.core.commands import MEANINGLESS, start

PROGRAM = Program(
    "python -m parity",
    {
        # 1 says that something differs, 2 that it could not be tried
        function.__name__.replace("_", "-"): Command(function, MEANINGLESS)
        for function in (
            compare,
            replay,
            rollout,
            render,
            sweep,
            report,
            inventory,
            tables,
        )
    },
)
main = PROGRAM.main

if __name__ == "__main__":
    start(main)
