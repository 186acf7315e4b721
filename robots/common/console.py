"""``robot-layouts COMMAND``: the table of all commands, and how one of them is run.

``python -m tasks`` runs whatever is called ``tasks`` in the present folder. A console script looks
for this library first: the folder comes last, for the modules of tasks, experts and policies.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module, metadata
from typing import Any, NamedTuple, NoReturn

from robots.common.commands import FAILED, MEANINGLESS, exit_code, print_error, start
from robots.common.errors import UnknownNameError

NAME = "robot-layouts"


class Command(NamedTuple):
    """A command of the console script.

    Attributes:
        module: What runs it, with ``add_arguments(parser)`` and ``run(options)``.
        about: What it does, as a sentence without its capital letter and full stop.
        failed: The exit code after an error of this library.
    """

    module: str
    about: str
    failed: int = FAILED


FOR_USERS: Mapping[str, Command] = {
    "demo": Command(
        "rollouts.demo_command",
        "let an expert play a task, and keep a recording, a picture and a video",
    ),
    "record": Command(
        "rollouts.recording.record_command",
        "let an expert or a policy play episodes in worker processes, and record them",
    ),
    "teleop": Command(
        "rollouts.teleop.command",
        "steer the arms of a task in a browser, and record the episodes that you keep",
    ),
    "replay": Command(
        "rollouts.playing.replay_command",
        "play the actions of a recording again, and compare what happens",
    ),
    "certify": Command(
        "rollouts.dataset.certify_command",
        "play every episode of a recording again, and certify that every bit is the same",
    ),
    "convert": Command(
        "rollouts.recording.convert_command",
        "record the episodes of a recording again in another control mode",
    ),
    "export": Command(
        "rollouts.export.command", "write a recording as a dataset for LeRobot or robomimic"
    ),
    "report": Command(
        "rollouts.dataset.report_command",
        "write one HTML page on a data set: counts, lengths, sources, variations, clips",
    ),
    "view": Command("rollouts.view_command", "look at an episode of a recording in a browser"),
    "evaluate": Command(
        "rollouts.evaluate_command",
        "let a policy or an expert play episodes, and print how well it does",
    ),
    "verify": Command(
        "rollouts.receipts.verify_command",
        "play the episodes of a receipt again, and compare every bit",
    ),
    "suite": Command(
        "rollouts.suite.command", "show, play, report or verify a suite of tasks, with receipts"
    ),
    "tasks": Command("tasks.__main__", "list tasks, describe one, or look at one"),
    "layouts": Command("layouts.__main__", "show, validate, search, view or export a layout"),
    "motion": Command("motion.__main__", "plan motions that do not collide, and look at them"),
    "robots list": Command(
        "robots.listing", "list the robots: joints, action numbers, reach, source of the numbers"
    ),
    "robots inspect": Command(
        "robots.inspect", "print everything about robots, or try them in physics"
    ),
    "robots fetch": Command(
        "robots.fetch_assets", "bring the files of robots to this machine, or check them"
    ),
    "robots guess": Command(
        "robots.from_urdf", "guess a robot's descriptor from its URDF or MJCF, and say why"
    ),
    "new task": Command(
        "tasks.new_task", "write the file of a new task and its expert, and a test"
    ),
    "new robot": Command(
        "robots.new_robot", "write the file of a new robot from its URDF, and a test"
    ),
}

FOR_DEVELOPERS: Mapping[str, Command] = {
    "portable": Command(
        "robots.portable",
        "run a program so that physics has the same bits on every x86-64 processor",
    ),
    "robots manifest": Command(
        "robots.write_manifest",
        "write the manifest of robot files from installed packages, when a robot is added",
    ),
}

COMMANDS: Mapping[str, Command] = {**FOR_USERS, **FOR_DEVELOPERS}


def run() -> NoReturn:
    """Be the console script."""
    start(main)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: Words after ``robot-layouts``; by default those of this process.

    Returns:
        The command's exit code; 2 if there is no such command.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if words[0] == "--version":
        print(f"{NAME} {metadata.version(NAME)}")
        return 0
    if words[0] == "help":
        words = [*words[1:], "--help"]
    if words[0] in ("-h", "--help"):
        print(f"usage: {NAME} COMMAND ...\n\n{_rows(FOR_USERS)}")
        print(f"\nfor developers of the library:\n{_rows(FOR_DEVELOPERS)}")
        print(f"\n`{NAME} help COMMAND` describes one of them.")
        return 0
    group = {name: about for name, about in COMMANDS.items() if name.startswith(f"{words[0]} ")}
    if group and (not words[1:] or words[1] in ("-h", "--help")):
        print(f"usage: {NAME} {words[0]} COMMAND ...\n\n{_rows(group)}")
        return 0
    with suppress(OSError):  # it may have been deleted
        if (folder := os.getcwd()) not in sys.path:
            sys.path.append(folder)
    try:
        options = parse(words)
    except UnknownNameError as error:
        print_error(error)
        return MEANINGLESS
    return exit_code(lambda: options.run(options), failed=options.failed)


def main_of(name: str) -> Callable[..., int]:
    """Return what ``python -m`` runs for a command, or for all with the same first word."""
    return lambda arguments=None: main(
        [*name.split(), *(sys.argv[1:] if arguments is None else arguments)]
    )


def name_of(words: Sequence[str]) -> str:
    """Return the name of the command that a command line begins with.

    Raises:
        UnknownNameError: If there is no such command.
    """
    for count in (2, 1):
        if (name := " ".join(words[:count])) in COMMANDS:
            return name
    group = [name for name in COMMANDS if name.startswith(f"{words[0]} ")]
    raise UnknownNameError("command", " ".join(words[: 1 + bool(group)]), group or COMMANDS)


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command's own words."""
    command = COMMANDS[name]
    module: Any = import_module(command.module)
    parser = Parser(prog=f"{NAME} {name}", description=sentence(command.about))
    parser.set_defaults(run=module.run, failed=command.failed)
    module.add_arguments(parser)
    return parser


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line; argparse ends the process if they make no sense.

    Raises:
        UnknownNameError: If there is no such command.
    """
    name = name_of(words)
    return parser_of(name).parse_args(words[len(name.split()) :])


def add_command(commands: Any, name: str, about: str, epilog: str | None = None) -> Parser:
    """Add a command of a command's own; see `Command.about`."""
    return commands.add_parser(name, help=about, description=sentence(about), epilog=epilog)


def sentence(text: str) -> str:
    """Return a text with a capital letter and a full stop."""
    text = text if text[:1] in "`" else f"{text[:1].upper()}{text[1:]}"
    return f"{text.rstrip('.')}." if text else "–"


class HelpFormatter(argparse.HelpFormatter):
    """Shows which options are required: they come first in the usage, and their help says so."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        """Write the usage, required options first."""
        super().add_usage(usage, sorted(actions, key=lambda one: not one.required), groups, prefix)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        is_required = action.option_strings and action.required
        return f"{action.help} (required)" if is_required else action.help


class Parser(argparse.ArgumentParser):
    """A parser whose help, and that of its commands, is written by `HelpFormatter`."""

    def __init__(self, **options: Any) -> None:
        """Take what `argparse.ArgumentParser` takes."""
        options.setdefault("formatter_class", HelpFormatter)
        super().__init__(**options)


def _rows(commands: Mapping[str, Command]) -> str:
    width = max(map(len, COMMANDS))
    return "\n".join(f"  {name:<{width}}  {command.about}" for name, command in commands.items())
