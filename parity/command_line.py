"""How the tools of a checkout are run: ``python -m parity``, ``python -m benchmarks``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

import tyro

from robots import RobotLayoutsError

FAILED, MEANINGLESS, INTERRUPTED = 1, 2, 130  # exit codes


def run_command(
    program: str, commands: Mapping[str, Callable[..., int]], words: Sequence[str] | None
) -> int:
    """Run the command that a command line names.

    Args:
        program: The module, as after ``python -m``.
        commands: Functions by name; their arguments are the options, their docstrings the help.
        words: The command line; None is that of this process.

    Returns:
        The command's exit code; 2 if it could not be run, 130 after Ctrl-C.
    """
    try:
        return tyro.extras.subcommand_cli_from_dict(
            {name.replace("_", "-"): command for name, command in commands.items()},
            prog=f"python -m {program}",
            args=words,
            config=(tyro.conf.FlagCreatePairsOff,),
        )
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return MEANINGLESS
    except KeyboardInterrupt:
        return INTERRUPTED
