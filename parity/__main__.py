"""``python -m parity COMMAND``: the comparisons with native ManiSkill."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

from robots import UnknownNameError
from robots.common.commands import MEANINGLESS, exit_code, print_error, program, start

# Command -> the module whose ``main(argv)`` runs it, and what it does.
COMMANDS = {
    "inventory": ("parity.records.inventory", "list every task, and what proves it"),
    "compare": ("parity.compare.command", "step tasks beside native and compare every bit"),
    "replay": ("parity.replay.command", "play recorded actions beside native, episode by episode"),
    "rollout": (
        "parity.replay.rollout",
        "play one episode in native and here, and keep its arrays",
    ),
    "render": ("parity.show.command", "show native and ours side by side, with their difference"),
    "sweep": (
        "parity.sweep.command",
        "rollouts, agreement and clips of every task, in one summary",
    ),
    "report": (
        "parity.report.command",
        "make one HTML page of a sweep and the recorded results",
    ),
    "bench": ("measurements.bench.native", "time steps, resets and vectors beside native"),
    "tables": (
        "measurements.tables",
        "write the recorded results into docs/parity.md, or check them there",
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code, 2 if there is no such command or it makes no sense."""
    command, *rest = list(sys.argv[1:] if argv is None else argv) or ["--help"]
    if command in ("-h", "--help"):
        print(f"usage: {program('parity')} {{{','.join(COMMANDS)}}} ...\n")
        for name, (_, description) in COMMANDS.items():
            print(f"  {name:<10} {description}")
        return 0
    if command not in COMMANDS:
        print_error(UnknownNameError("command", command, COMMANDS))
        return MEANINGLESS
    return exit_code(lambda: import_module(COMMANDS[command][0]).main(rest), failed=MEANINGLESS)


if __name__ == "__main__":
    start(main)
